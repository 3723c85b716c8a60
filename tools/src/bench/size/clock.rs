//! Processor time of this process on one core, over all its threads. Busy neighbours disturb this time least.

/// Number of timed repetitions in a row in each round, after one that is not counted.
pub(super) const IN_A_ROW: usize = 2;

/// Keeps this process and the library's workers on one core. Call before any thread starts.
pub(super) fn stay_on_one_core() {
    // If a pool exists, this runs in a test, which does not judge times.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).build_global();
    #[cfg(target_os = "linux")]
    if let Ok(allowed) = rustix::thread::sched_getaffinity(None)
        && let Some(first) = (0..rustix::thread::CpuSet::MAX_CPU).find(|core| allowed.is_set(*core))
    {
        let mut one = rustix::thread::CpuSet::new();
        one.set(first);
        let _ = rustix::thread::sched_setaffinity(None, &one); // where that is refused, one worker must do
    }
}

/// Seconds of processor time so far.
#[cfg(target_os = "linux")]
pub(super) fn seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Seconds of wall time, on systems where processor time is not implemented here.
#[cfg(not(target_os = "linux"))]
pub(super) fn seconds() -> f64 {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    START.get_or_init(std::time::Instant::now).elapsed().as_secs_f64()
}

/// Runs `work` once without timing and then `repeats` times. Returns its result and the least time in seconds.
pub(super) fn least<T, E>(repeats: usize, mut work: impl FnMut() -> Result<T, E>) -> Result<(T, f64), E> {
    let (mut result, mut least) = (work()?, f64::INFINITY);
    for _ in 0..repeats {
        drop(result);
        let started = seconds();
        result = work()?;
        least = least.min(seconds() - started);
    }
    Ok((result, least))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_time_is_not_counted_and_the_last_result_is_returned() {
        let mut calls = 0;
        let (result, seconds) = least(2, || {
            calls += 1;
            Ok::<_, ()>(calls)
        })
        .expect("it works");
        assert_eq!(result, 3);
        assert!((0.0..1.0).contains(&seconds), "{seconds}");
    }
}
