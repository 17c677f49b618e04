// SPDX-License-Identifier: GPL-3.0-or-later
//! The cases of ray and split plane distinguished by Havran, Kopal, Bittner and Žára 1997: the origin lies
//! below the plane (N), above it (P) or in it (Z), and the digit stands for the ray's direction.

/// Number of counters that a traversal may have of its own: the cases, and one more.
pub const CASES: usize = 14;

/// Index of the counter behind the cases.
pub const BEHIND: usize = 13;

/// Names of the cases. N and P: 1 away from the plane, 2 parallel to it, 3 towards it but the cell ends before,
/// 4 through it inside the cell, 5 through it before the cell begins. Z: 1 upwards, 2 downwards, 3 parallel.
pub const NAMES: [&str; BEHIND] = [
    "case_n1", "case_n2", "case_n3", "case_n4", "case_n5", "case_p1", "case_p2", "case_p3",
    "case_p4", "case_p5", "case_z1", "case_z2", "case_z3",
];

/// The children of a split node that the traversal visits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// Only the child below the plane.
    Below,
    /// Only the child above the plane.
    Above,
    /// Both children.
    Both,
}

/// Returns the index into [`NAMES`] of the case of a ray with this origin coordinate and direction component along the
/// plane's axis; `turn` is the traversal's decision.
#[inline(always)]
pub fn case(origin: f32, speed: f32, split: f32, turn: Turn) -> usize {
    // Offset within the cases of one side for rays that approach the plane.
    let inside = |near, far| match turn {
        Turn::Both => 3,
        turn if turn == near => 2,
        turn if turn == far => 4,
        _ => unreachable!("there are two children"),
    };
    // Compare the origin with the plane, then the direction.
    if origin < split {
        match speed {
            x if x < 0.0 => 0,
            0.0 => 1,
            _ => inside(Turn::Below, Turn::Above),
        }
    } else if origin > split {
        match speed {
            x if x > 0.0 => 5,
            0.0 => 6,
            _ => 5 + inside(Turn::Above, Turn::Below),
        }
    } else {
        match speed {
            x if x > 0.0 => 10,
            x if x < 0.0 => 11,
            _ => 12,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_its_name() {
        let named = |origin, speed, turn| NAMES[case(origin, speed, 0.0, turn)];
        for (origin, speed, turn, name) in [
            (-1.0, -1.0, Turn::Below, "case_n1"),
            (-1.0, -0.0, Turn::Below, "case_n2"),
            (-1.0, 1.0, Turn::Below, "case_n3"),
            (-1.0, 1.0, Turn::Both, "case_n4"),
            (-1.0, 1.0, Turn::Above, "case_n5"),
            (1.0, 1.0, Turn::Above, "case_p1"),
            (1.0, 0.0, Turn::Above, "case_p2"),
            (1.0, -1.0, Turn::Above, "case_p3"),
            (1.0, -1.0, Turn::Both, "case_p4"),
            (1.0, -1.0, Turn::Below, "case_p5"),
            (-0.0, 1.0, Turn::Both, "case_z1"),
            (0.0, -1.0, Turn::Both, "case_z2"),
            (0.0, 0.0, Turn::Below, "case_z3"),
        ] {
            assert_eq!(named(origin, speed, turn), name);
        }
    }
}
