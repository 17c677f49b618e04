// SPDX-License-Identifier: GPL-3.0-or-later
//! The choice among many lights: a tree over those that have a place, and suns and the background by brightness.

use super::super::light_tree::{Ball, LightTree};
use super::Receiver;
use super::light::Light;

/// What chooses among more lights than can be weighed one by one.
pub(super) struct Many {
    /// Everything that has a place.
    tree: LightTree,
    /// Lamps that a ray can meet and that have a place.
    pub(super) met: LightTree,
    /// Suns and the background.
    pub(super) far: Vec<u32>,
    /// Running sum of their brightness, 0 to 1, for when they are many as well.
    far_running: Vec<f32>,
    far_brightness: f32,
}

impl Many {
    pub(super) fn new(lights: &[Light], lamps: usize) -> Self {
        let ball = |(i, light): (usize, &Light)| light.ball(i as u32);
        let all = lights.iter().enumerate();
        let near: Vec<Ball> = all.clone().filter_map(ball).collect();
        let met = all
            .clone()
            .take(lamps)
            .filter(|(_, light)| light.can_be_met())
            .filter_map(ball)
            .collect();
        let far: Vec<u32> = all
            .filter(|(_, light)| light.is_far())
            .map(|(i, _)| i as u32)
            .collect();
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
            met: LightTree::new(met, lights.len()),
            far,
            far_running: running.into_iter().map(|r| r as f32).collect(),
            far_brightness: sum as f32,
        }
    }

    /// The share of the choices that go to suns and the background.
    fn share_of_far(&self, receiver: Receiver) -> Option<f32> {
        let (near, far) = (self.tree.importance(receiver), self.far_brightness);
        match (near > 0.0, far > 0.0) {
            // A bound says little about what really arrives, so neither is starved.
            (true, true) => Some((far / (near + far)).clamp(0.1, 0.9)),
            (true, false) => Some(0.0),
            (false, true) => Some(1.0),
            (false, false) => None,
        }
    }

    fn far_probability(&self, position: usize) -> f32 {
        let before = position.checked_sub(1).map_or(0.0, |p| self.far_running[p]);
        self.far_running[position] - before
    }

    pub(super) fn choose(
        &self,
        lights: &[Light],
        receiver: Receiver,
        choice: f32,
    ) -> Option<(usize, f32)> {
        let share = self.share_of_far(receiver)?;
        if choice < share {
            let left = choice / share;
            let position = self.far_running.partition_point(|&c| c <= left);
            let position = position.min(self.far.len() - 1);
            let index = self.far[position] as usize;
            let probability = self.far_probability(position) * share;
            return (lights[index].importance(receiver) > 0.0).then_some((index, probability));
        }
        let left = ((choice - share) / (1.0 - share)).min(1.0 - f32::EPSILON);
        let (index, probability) = self.tree.choose(receiver, left)?;
        Some((index, probability * (1.0 - share)))
    }

    pub(super) fn probability(&self, lights: &[Light], receiver: Receiver, index: usize) -> f32 {
        let Some(share) = self.share_of_far(receiver) else {
            return 0.0;
        };
        if lights[index].is_far() {
            let position = self.far.partition_point(|&f| (f as usize) < index);
            self.far_probability(position) * share
        } else {
            self.tree.probability(receiver, index) * (1.0 - share)
        }
    }
}
