//! Several pairs at once, each on threads of its own, so that its times are its own.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::{Error, Result};

/// How the machine is shared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Workers {
    /// Pairs at once.
    pub jobs: usize,
    /// Threads of each.
    pub threads: usize,
}

impl Workers {
    /// `threads` in all (0: one for each core), `jobs` pairs at once (0: one for each thread).
    pub fn new(threads: usize, jobs: usize) -> Self {
        let all = if threads == 0 {
            std::thread::available_parallelism().map_or(1, usize::from)
        } else {
            threads
        };
        let jobs = if jobs == 0 { all } else { jobs };
        Self { jobs, threads: (all / jobs).max(1) }
    }

    /// Does `work` for each of `0..n`; the answers come in that order. After a failure nothing new
    /// is begun, and the failure of the lowest number is returned.
    pub(crate) fn each<T: Send>(
        &self,
        n: usize,
        work: impl Fn(usize) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        let next = AtomicUsize::new(0);
        let slots: Mutex<Vec<Option<Result<T>>>> = Mutex::new((0..n).map(|_| None).collect());
        let pools = (0..self.jobs.min(n))
            .map(|_| {
                rayon::ThreadPoolBuilder::new()
                    .num_threads(self.threads)
                    .build()
                    .map_err(|error| Error::invalid("jobs", "threads to be had", error.to_string()))
            })
            .collect::<Result<Vec<_>>>()?;
        std::thread::scope(|scope| {
            for pool in &pools {
                scope.spawn(|| {
                    loop {
                        let i = next.fetch_add(1, Ordering::Relaxed);
                        if i >= n {
                            break;
                        }
                        let answer = pool.install(|| work(i));
                        if answer.is_err() {
                            next.store(n, Ordering::Relaxed);
                        }
                        // A poisoned lock means that a worker panicked, which the scope passes on.
                        if let Ok(mut slots) = slots.lock() {
                            slots[i] = Some(answer);
                        }
                    }
                });
            }
        });
        let slots = slots.into_inner().unwrap_or_default();
        slots.into_iter().flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_come_in_order_and_the_first_failure_is_returned() {
        let workers = Workers::new(3, 3);
        assert_eq!(workers.each(20, |i| Ok(i * i)).unwrap()[19], 361);
        assert!(workers.each(0, Ok).unwrap().is_empty());
        let fail = |i| if i == 7 { Err(Error::invalid("seven", "another", "7")) } else { Ok(i) };
        assert!(workers.each(1000, fail).unwrap_err().to_string().contains("seven"));
    }

    #[test]
    fn threads_are_shared_among_jobs() {
        assert_eq!(Workers::new(8, 2), Workers { jobs: 2, threads: 4 });
        assert_eq!(Workers::new(4, 0), Workers { jobs: 4, threads: 1 });
        assert_eq!(Workers::new(2, 5), Workers { jobs: 5, threads: 1 });
    }
}
