//! How many worker threads a limit of address space (`ulimit -v`) leaves room for.
//!
//! faer's matrix products reserve, for each thread that makes one, two buffers of the size of the processor's last
//! cache; on a server that is half a gigabyte a thread, of which little is ever touched. A limit of address space counts
//! what is reserved, and an allocation beyond it ends the process.

/// What a worker takes besides: its stack and the allocator's arena.
const PER_WORKER: u64 = 80 << 20;

/// What the program's own data take: meshes, bases, pictures.
const FOR_DATA: u64 = 512 << 20;

/// As many of the `wanted` workers (0: one for each core) as there is room for, at least one.
pub fn workers_that_fit(wanted: usize) -> usize {
    let wanted = match wanted {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        n => n,
    };
    match (limit(), last_cache()) {
        (Some(limit), Some(cache)) => fitting(wanted, limit, cache),
        _ => wanted,
    }
}

fn fitting(wanted: usize, limit: u64, cache: u64) -> usize {
    let each = 2 * cache + PER_WORKER;
    let room = limit.saturating_sub(FOR_DATA) / each;
    wanted.min(usize::try_from(room).unwrap_or(usize::MAX)).max(1)
}

/// The limit of address space in bytes, where the system tells one.
fn limit() -> Option<u64> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find(|line| line.starts_with("Max address space"))?;
    line.split_whitespace().nth(3)?.parse().ok()
}

/// Size of the last cache in bytes, where the system tells it.
fn last_cache() -> Option<u64> {
    let text = std::fs::read_to_string("/sys/devices/system/cpu/cpu0/cache/index3/size").ok()?;
    text.trim().strip_suffix('K')?.parse::<u64>().ok().map(|kilobytes| kilobytes << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_leaves_fewer_workers_and_always_one() {
        let (small, large) = (32 << 20, 260 << 20);
        assert_eq!(fitting(8, u64::MAX, large), 8);
        assert_eq!(fitting(8, 4 << 30, small), 8);
        assert_eq!(fitting(8, 4 << 30, large), 5);
        assert_eq!(fitting(8, 100 << 20, large), 1);
        assert!(workers_that_fit(2) <= 2 && workers_that_fit(0) >= 1);
    }
}
