// SPDX-License-Identifier: GPL-3.0-or-later
//! Limits on the memory that work may take. They are checked before the memory is allocated: when the system runs
//! out of memory it ends the process, and Blender with it, without a message.

use crate::error::{Error, Result};
use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// Sizes up to this pass without a query to the system (64 MiB, chosen).
const SMALL: u64 = 64 << 20;

/// Returns the limit in bytes that applies unless the user sets one: seven eighths of the free memory of the
/// machine or the container, whichever is smaller. Work that exceeds it would swap, or the system would end the
/// process.
pub fn default_limit() -> u64 {
    let kind = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(kind);
    // A container releases the file cache it holds when memory is short; this cache counts as free, as on the
    // machine.
    let container = system
        .cgroup_limits()
        .map_or(u64::MAX, |c| c.total_memory.saturating_sub(c.rss));
    match system.available_memory().min(container) {
        // The system does not report its free memory.
        0 => u64::MAX,
        free => free / 8 * 7,
    }
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
}
