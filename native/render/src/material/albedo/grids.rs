// SPDX-License-Identifier: GPL-3.0-or-later
//! The grids of a scene, each computed once and shared by all materials that need it. Those of the last scene are kept
//! for the next one, which mostly is the same after a change: a frame of an animation, or an edit in the viewport.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::material::albedo::{Axis, Grid, Lobe};

/// Key of a grid: the lobe, and the ranges of roughness and index.
type Key = (Lobe, [u32; 3], [u32; 3]);

/// The grids of the last scene.
static KEPT: Mutex<Option<HashMap<Key, Arc<Grid>>>> = Mutex::new(None);

/// The grids of a scene.
#[derive(Debug, Default)]
pub struct Grids {
    own: HashMap<Key, Arc<Grid>>,
    kept: HashMap<Key, Arc<Grid>>,
}

impl Grids {
    /// Returns no grids; those of the last scene need not be computed again.
    pub fn after_last_scene() -> Self {
        let kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        Self {
            own: HashMap::new(),
            kept: kept.clone().unwrap_or_default(),
        }
    }

    /// Keeps the grids of this scene for the next one.
    pub fn keep(self) {
        *KEPT.lock().unwrap_or_else(PoisonError::into_inner) = Some(self.own);
    }

    /// Returns the grid of a lobe over these ranges, computing it at the first request.
    pub fn get(&mut self, lobe: Lobe, roughness: Axis, index: Axis) -> Arc<Grid> {
        // White facets have no index: one grid serves all.
        let index = if lobe == Lobe::Reflection {
            Axis::fixed(1.0)
        } else {
            index
        };
        let key = (lobe, roughness.key(), index.key());
        let known = self.kept.get(&key).cloned();
        let grid = (self.own.entry(key)).or_insert_with(|| {
            known.unwrap_or_else(|| Arc::new(Grid::new(lobe, roughness, index)))
        });
        Arc::clone(grid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_of_the_last_scene_are_not_computed_again() {
        let asked = |grids: &mut Grids, roughness: f32| {
            grids.get(Lobe::Dielectric, Axis::fixed(roughness), Axis::fixed(1.5))
        };
        let mut first = Grids::default();
        let [a, b] = [0.25, 0.75].map(|roughness| asked(&mut first, roughness));
        assert!(!Arc::ptr_eq(&a, &b));
        // Not through the static, which other tests change at the same time.
        let mut next = Grids {
            kept: first.own,
            ..Grids::default()
        };
        assert!(Arc::ptr_eq(&asked(&mut next, 0.75), &b));
        // Only what the next scene uses goes on.
        assert_eq!((next.own.len(), next.kept.len()), (1, 2));
        let computed = asked(&mut Grids::default(), 0.25);
        assert_eq!(
            computed.at(0.25, 1.5, 0.3).directional,
            a.at(0.25, 1.5, 0.3).directional
        );
    }
}
