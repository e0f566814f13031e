//! Memory use of the process.

use std::fs;

/// Returns the anonymous resident memory of the process (RssAnon), MB, or `None` if the kernel does not report it.
pub fn private_memory_mb() -> Option<f64> {
    fs::read_to_string("/proc/self/status").ok().and_then(|status| anonymous_mb(&status))
}

fn anonymous_mb(status: &str) -> Option<f64> {
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    let kibibytes: u32 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(f64::from(kibibytes) * 1.024e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_parsed_from_proc_status() {
        let status = "Name:\tvirtual_axes\nVmRSS:\t   9000 kB\nRssAnon:\t    1000 kB\nThreads:\t12\n";
        assert_eq!(anonymous_mb(status), Some(1.024));
        assert_eq!(anonymous_mb("Name:\tvirtual_axes\n"), None);
        assert_eq!(anonymous_mb("RssAnon:\tmany kB\n"), None);
    }
}
