// SPDX-License-Identifier: GPL-3.0-or-later
//! The shares of work that builds report.

use halfspace::base::Monitor;
use halfspace::oracle::cases::{grid, soup};
use halfspace::registry;
use halfspace::structure::Structure;

#[test]
fn every_build_reports_all_its_work_once() {
    let scene = soup(grid(8, 0.3));
    for tree in registry::TREES.iter().filter(|tree| tree.id != "brute") {
        for spec in tree.spelled_ways() {
            let monitor = Monitor::new();
            let config = registry::parse(&spec).unwrap();
            Structure::build(scene.clone(), config, 2, &monitor).unwrap();
            let advanced = monitor.advanced();
            assert!((advanced - 1.0).abs() < 1e-6, "{spec}: {advanced}");
        }
    }
}
