#!/bin/sh
# What a graphics processor brings: views by its driver, and the encoder on CUDA. Runs on any machine
# with a driver, be it one that draws on the CPU (lavapipe), and says who drew.
#
#     pip install '.[embed]'                  # for MODEL; '.[onnx]' for an encoder's JSON
#     bench/gpu.sh MESH [MODEL]
#
# MODEL is what `semfm-embed --model` takes; without it the encoder is left out. BIN=FOLDER takes
# programs that are built (semfm-cli and examples/bench_render) instead of building them, DEVICE=cpu
# keeps the encoder off CUDA, REPEATS is 15.
set -eu
mesh=${1:?which mesh?}
model=${2:-}
root=$(cd "$(dirname "$0")/.." && pwd)
if [ -z "${BIN:-}" ]; then
    (cd "$root" && cargo build --release -p semfm-cli -p semfm-views --bin semfm-cli --example bench_render)
    BIN=$root/target/release
fi
if command -v nvidia-smi >/dev/null 2>&1; then
    nvidia-smi --query-gpu=name,driver_version --format=csv,noheader || true
fi

# Views, read back; while one batch is read the next is drawn. The CPU's beside them, in the same run.
"$BIN/examples/bench_render" "$mesh" --who cpu,driver --repeats "${REPEATS:-15}" \
    --shots 14x224,64x224,14x448,64x448,14x512,64x512

if [ -n "$model" ]; then
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    for count in 14 64; do
        "$BIN/semfm-cli" views "$mesh" -o "$folder/v.mcap" --count $count --renderer gpu --quiet >/dev/null
        echo "encoder, $count views × 4 rolls at 224 px, ${DEVICE:-cuda}:"
        semfm-embed "$folder/v.mcap" -o "$folder/e.mcap" --model "$model" --device "${DEVICE:-cuda}" \
            --progress none 2>&1 >/dev/null
    done
fi
