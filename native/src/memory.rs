// SPDX-License-Identifier: GPL-3.0-or-later
//! How much memory work may take. Asked before it is taken: a system that has run out of memory ends the process,
//! and Blender with it, without a word.

use crate::error::{Error, Result};
use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// Less than this is not worth asking the system about.
const SMALL: u64 = 64 << 20;

/// The limit where the user gives none: seven eighths of what the machine, or the container, has free now.
/// What does not fit into that would end by swapping, or by being killed.
pub fn default_limit() -> u64 {
    let kind = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(kind);
    // What a container holds in caches of files it gives back; it counts as free, as it does for the machine.
    let container = system
        .cgroup_limits()
        .map_or(u64::MAX, |c| c.total_memory.saturating_sub(c.rss));
    match system.available_memory().min(container) {
        // A system that does not tell.
        0 => u64::MAX,
        free => free / 8 * 7,
    }
}

/// Passes when `bytes` fit into the default limit.
///
/// # Errors
/// [`Error::Memory`] that names `what` needs them.
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

/// A size for messages.
pub fn megabytes(bytes: u64) -> String {
    format!("{} MB", bytes.div_ceil(1_000_000))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_tells_and_the_impossible_is_refused() {
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
