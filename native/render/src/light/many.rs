// SPDX-License-Identifier: GPL-3.0-or-later
//! The choice among many lights: a tree over those at finite distances; suns and the background by brightness.

use crate::light::Receiver;
use crate::light::prepared::Light;
use crate::light::tree::{BoundingSphere, LightTree};

/// Chooses among more lights than [`crate::light::MAX_COMPARED`].
pub(super) struct Many {
    /// All lights at finite distances.
    pub(super) tree: LightTree,
    /// Lamps at finite distances that a ray can hit.
    pub(super) hittable: LightTree,
    /// Indices of suns and the background, ascending.
    pub(super) far: Vec<u32>,
    /// Normalized running sum of their brightness, for choosing by binary search.
    far_running: Vec<f32>,
    /// Sum of their brightness.
    pub(super) far_brightness: f32,
}

impl Many {
    /// Builds the trees. `lamps`: number of lights that are lamps, which come first.
    pub(super) fn new(lights: &[Light], lamps: usize) -> Self {
        // Sort the lights into trees (finite distance) and a list (suns and background).
        let sphere = |(i, light): (usize, &Light)| light.bounding_sphere(i as u32);
        let all = lights.iter().enumerate();
        let near: Vec<BoundingSphere> = all.clone().filter_map(sphere).collect();
        let hittable = all
            .clone()
            .take(lamps)
            .filter(|(_, light)| light.is_hittable())
            .filter_map(sphere)
            .collect();
        let far: Vec<u32> = all
            .filter(|(_, light)| light.is_far())
            .map(|(i, _)| i as u32)
            .collect();
        // Sum up in f64, so that the shares of many lights stay accurate.
        let mut sum = 0.0_f64;
        let mut running: Vec<f64> = far
            .iter()
            .map(|&f| {
                sum += f64::from(lights[f as usize].brightness);
                sum
            })
            .collect();
        running.iter_mut().for_each(|r| *r /= sum);
        Self {
            tree: LightTree::new(near, lights.len()),
            hittable: LightTree::new(hittable, lights.len()),
            far,
            far_running: running.into_iter().map(|r| r as f32).collect(),
            far_brightness: sum as f32,
        }
    }

    /// Returns the probability of choosing a light from `far`; `None` if no light can contribute.
    fn share_of_far(&self, receiver: Receiver) -> Option<f32> {
        self.share_of_far_from(self.tree.importance(receiver), self.far_brightness)
    }

    /// Returns the probability of choosing from `far`, by the estimates of both sides; `None` if both are 0.
    pub(super) fn share_of_far_from(&self, near: f32, far: f32) -> Option<f32> {
        match (near > 0.0, far > 0.0) {
            // The tree's estimate is only an upper bound of the irradiance, so give both sides at least a tenth.
            (true, true) => Some((far / (near + far)).clamp(0.1, 0.9)),
            (true, false) => Some(0.0),
            (false, true) => Some(1.0),
            (false, false) => None,
        }
    }

    /// Returns the probability of the light at `position` in `far`, among the far ones.
    fn far_probability(&self, position: usize) -> f32 {
        // Use the difference of the rounded running sums, because `choose` compares with these.
        let before = position.checked_sub(1).map_or(0.0, |p| self.far_running[p]);
        self.far_running[position] - before
    }

    /// Chooses a light by a random number in [0, 1). Returns its index and its probability; `None` if the light
    /// cannot contribute.
    pub(super) fn choose(
        &self,
        lights: &[Light],
        receiver: Receiver,
        choice: f32,
    ) -> Option<(usize, f32)> {
        let share = self.share_of_far(receiver)?;
        let found = self.choose_side(share, choice, |left| self.tree.choose(receiver, left));
        found.filter(|&(index, _)| {
            !lights[index].is_far() || lights[index].importance(receiver) > 0.0
        })
    }

    /// Chooses among the far lights with probability `share`, and otherwise by `near`, which gets a random number in
    /// [0, 1). Returns the light's index and its probability.
    #[inline]
    pub(super) fn choose_side(
        &self,
        share: f32,
        choice: f32,
        near: impl FnOnce(f32) -> Option<(usize, f32)>,
    ) -> Option<(usize, f32)> {
        if choice < share {
            // Use the random number again, rescaled to the chosen side's share.
            let left = choice / share;
            let position = self.far_running.partition_point(|&c| c <= left);
            let position = position.min(self.far.len() - 1);
            let index = self.far[position] as usize;
            return Some((index, self.far_probability(position) * share));
        }
        let left = ((choice - share) / (1.0 - share)).min(1.0 - f32::EPSILON);
        let (index, probability) = near(left)?;
        Some((index, probability * (1.0 - share)))
    }

    /// Returns the probability with which [`Self::choose`] chooses a light.
    pub(super) fn probability(&self, lights: &[Light], receiver: Receiver, index: usize) -> f32 {
        let Some(share) = self.share_of_far(receiver) else {
            return 0.0;
        };
        if lights[index].is_far() {
            // The list is ascending, so the light's position is found by binary search.
            let position = self.far.partition_point(|&f| (f as usize) < index);
            self.far_probability(position) * share
        } else {
            self.tree.probability(receiver, index) * (1.0 - share)
        }
    }
}
