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
/// end the process. Where neither is reported, as without `/proc` and `/sys`, the largest number.
pub fn default_limit() -> u64 {
    let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let process = left_to_process(&read("/proc/self/limits"), &read("/proc/self/status"));
    match free_in_machine().min(left_to_container(read)) {
        u64::MAX => process,
        free => free.min(process) / 8 * 7,
    }
}

/// Free memory of the machine in bytes, the largest number where it is not reported.
fn free_in_machine() -> u64 {
    let kind = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(kind);
    if system.total_memory() == 0 {
        // Linux without `/proc`, as in a bare chroot: a system call remains.
        return free_without_files();
    }
    system.available_memory()
}

/// Free memory by Linux's call `sysinfo`, at least half of the whole: the call counts the file cache, which is released
/// when memory is short, as used.
#[cfg(target_os = "linux")]
fn free_without_files() -> u64 {
    let found = rustix::system::sysinfo();
    let bytes = |units: u64| units.saturating_mul(u64::from(found.mem_unit));
    bytes(found.freeram.saturating_add(found.bufferram)).max(bytes(found.totalram) / 2)
}

/// The largest number: other systems report their memory without files.
#[cfg(not(target_os = "linux"))]
fn free_without_files() -> u64 {
    u64::MAX
}

/// Bytes that a Linux container may still use, the largest number without a limit. The file cache counts as free, as
/// that of the machine. read: returns the text of a file, empty if there is none.
fn left_to_container(read: impl Fn(&str) -> String) -> u64 {
    // Version 2 of control groups, then version 1.
    [
        (
            "/sys/fs/cgroup/memory.max",
            "/sys/fs/cgroup/memory.stat",
            "anon ",
        ),
        (
            "/sys/fs/cgroup/memory/memory.limit_in_bytes",
            "/sys/fs/cgroup/memory/memory.stat",
            "total_rss ",
        ),
    ]
    .into_iter()
    // "max" is no number: there is no limit.
    .filter_map(|(limit, used, key)| {
        let limit = read(limit).trim().parse::<u64>().ok()?;
        Some(limit.saturating_sub(first_number(&read(used), key).unwrap_or(0)))
    })
    .min()
    .unwrap_or(u64::MAX)
}

/// The number at the beginning of the rest of the line that begins with `name`.
fn first_number(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Bytes that the process may still map, from the texts of Linux's `/proc/self/limits` and `/proc/self/status`; the
/// largest number where there is no limit, or no such files.
fn left_to_process(limits: &str, status: &str) -> u64 {
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
    fn limits_of_a_container_are_read() {
        fn left(files: &[(&str, &str)]) -> u64 {
            left_to_container(|path| {
                let found = files.iter().find(|(name, _)| path.ends_with(name));
                found.map_or_else(String::new, |(_, text)| (*text).to_owned())
            })
        }
        assert_eq!(left(&[]), u64::MAX);
        assert_eq!(left(&[("cgroup/memory.max", "max\n")]), u64::MAX);
        let stat = ("cgroup/memory.stat", "anon 300\nfile 500\nanon_thp 7\n");
        assert_eq!(left(&[("cgroup/memory.max", "1000\n"), stat]), 700);
        assert_eq!(left(&[("cgroup/memory.max", "1000\n")]), 1000);
        assert_eq!(left(&[("cgroup/memory.max", "200\n"), stat]), 0);
        let first = [
            ("memory/memory.limit_in_bytes", "4096\n"),
            ("memory/memory.stat", "cache 5\ntotal_rss 96\n"),
        ];
        assert_eq!(left(&first), 4000);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn memory_is_known_without_files() {
        let free = free_without_files();
        assert!((1 << 20..1 << 50).contains(&free), "{free}");
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
