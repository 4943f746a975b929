#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    semfm_tests::readers::read_bytes("exr", bytes);
});
