// SPDX-License-Identifier: GPL-3.0-or-later
//! Direction sets that are the same at every node.

use super::Source;
use crate::build::piece::Piece;
use crate::build::space::Node;

/// The same directions everywhere.
pub struct Fixed(pub Vec<[f32; 3]>);

impl Source for Fixed {
    fn directions<P: Piece>(&self, _: &Node<'_, P>, k: usize, out: &mut Vec<[f32; 3]>) {
        let known = out.len();
        out.extend(self.0.iter().take(k).skip(known));
    }
}

/// The thirteen directions with coordinates -1, 0 and 1: axes, then diagonals of the cube, then of its
/// faces (Klosowski et al. 1998). Halved, so that none is longer than 1 and products stay exact.
pub fn cube() -> Vec<[f32; 3]> {
    let half = 0.5;
    let mut set = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for (y, z) in [(half, half), (half, -half), (-half, half), (-half, -half)] {
        set.push([half, y, z]);
    }
    for sign in [half, -half] {
        set.extend([[half, sign, 0.0], [half, 0.0, sign], [0.0, half, sign]]);
    }
    set
}

/// `count` directions on a spiral over the half sphere, each with an equal share of it (Kammaje and Mora
/// 2007 have the idea; here with the golden angle).
pub fn spiral(count: usize) -> Vec<[f32; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / (2 * count) as f64;
            let radius = (1.0 - z * z).sqrt();
            let angle = golden * i as f64;
            #[expect(clippy::cast_possible_truncation, reason = "planes have f32 normals")]
            let n = [radius * angle.cos(), radius * angle.sin(), z].map(|x| x as f32);
            n
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trees::bsp::add_distinct;

    #[test]
    fn sets_hold_distinct_directions_no_longer_than_one() {
        for set in [cube(), spiral(26), spiral(3)] {
            let mut distinct = Vec::new();
            for &n in &set {
                let square: f32 = n.iter().map(|x| x * x).sum();
                assert!((0.49..1.000_001).contains(&square), "{n:?}");
                let unit = n.map(|x| x / square.sqrt());
                assert!(add_distinct(&mut distinct, unit), "{n:?} twice");
            }
        }
        assert_eq!(cube().len(), 13);
    }
}
