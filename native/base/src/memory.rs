// SPDX-License-Identifier: GPL-3.0-or-later
//! Limits on memory, checked before it is allocated: a system without free memory ends the process, and Blender with
//! it, without a message.

use crate::error::{Error, Result};
use std::fs;
use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// Largest size in bytes that is accepted without a query to the system (64 MiB, chosen).
const SMALL: u64 = 64 << 20;

/// Returns the limit in bytes that applies unless the user sets one: seven eighths of the free memory of the
/// machine, the container or the process (`ulimit -v`), whichever is smallest. Work that exceeds it would swap, or
/// end the process.
pub fn default_limit() -> u64 {
    let kind = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(kind);
    // Count the file cache of a container as free, as that of the machine: it is released when memory is short.
    let container = system
        .cgroup_limits()
        .map_or(u64::MAX, |c| c.total_memory.saturating_sub(c.rss));
    let read = |name| fs::read_to_string(format!("/proc/self/{name}")).unwrap_or_default();
    let process = left_to_process(&read("limits"), &read("status"));
    match system.available_memory().min(container) {
        // The system does not report its free memory.
        0 => process,
        free => free.min(process) / 8 * 7,
    }
}

/// Bytes that the process may still map, from the texts of Linux's `/proc/self/limits` and `/proc/self/status`; the
/// largest number where there is no limit, or no such files.
fn left_to_process(limits: &str, status: &str) -> u64 {
    let first_number = |text: &str, name: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next()?.parse::<u64>().ok()
    };
    [
        ("Max address space", "VmSize:"),
        ("Max data size", "VmData:"),
    ]
    .into_iter()
    // "unlimited" is no number. Sizes in use are in KiB.
    .filter_map(|(limit, used)| {
        let used = first_number(status, used)? << 10;
        Some(first_number(limits, limit)?.saturating_sub(used))
    })
    .min()
    .unwrap_or(u64::MAX)
}

/// Checks that `bytes` fit into the default limit.
///
/// # Errors
/// [`Error::Memory`], which names `what` and both sizes.
pub fn check_room(what: &str, bytes: u64) -> Result<()> {
    if bytes <= SMALL {
        return Ok(());
    }
    let limit = default_limit();
    if bytes <= limit {
        return Ok(());
    }
    Err(Error::Memory(format!(
        "{what}: needs {}, of {} that are free",
        megabytes(bytes),
        megabytes(limit)
    )))
}

/// Formats a size in bytes for messages, in whole megabytes, rounded up.
pub fn megabytes(bytes: u64) -> String {
    format!("{} MB", bytes.div_ceil(1_000_000))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_reports_its_memory_and_the_impossible_is_refused() {
        let limit = default_limit();
        assert!(limit > 1 << 20, "{limit}");
        check_room("x", 1).unwrap();
        let error = check_room("origins", u64::MAX - 1).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("origins: needs 18446744073710 MB"),
            "{error}"
        );
    }

    #[test]
    fn limits_of_the_process_are_read() {
        let limits = |space: &str, data: &str| {
            format!(
                "Limit                     Soft Limit           Hard Limit           Units     \n\
                 Max data size             {data}            unlimited            bytes     \n\
                 Max address space         {space}            unlimited            bytes     \n"
            )
        };
        let status = "Name:\tpython\nVmSize:\t    1000 kB\nVmData:\t     600 kB\n";
        let unlimited = limits("unlimited", "unlimited");
        assert_eq!(left_to_process(&unlimited, status), u64::MAX);
        assert_eq!(left_to_process("", ""), u64::MAX);
        assert_eq!(
            left_to_process(&limits("1034000", "unlimited"), status),
            10_000
        );
        assert_eq!(left_to_process(&limits("unlimited", "614401"), status), 1);
        // More in use than allowed, as after the limit was lowered.
        assert_eq!(left_to_process(&limits("5", "614401"), status), 0);
    }
}
