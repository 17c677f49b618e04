// SPDX-License-Identifier: GPL-3.0-or-later
//! Signs of edge functions that f64 computes without rounding, because coordinates have few bits or directions are along
//! axes. Most weights that are exactly 0 are such: those of rays through vertices and edges.

/// A difference of two f32, rounded to f64.
#[derive(Clone, Copy, Default)]
struct Difference {
    value: f64,
    /// Whether it is exact and an f32, so that products with another one are exact.
    short: bool,
}

impl Difference {
    #[inline(always)]
    fn new(p: f32, o: f32) -> Self {
        let (p, o) = (f64::from(p), f64::from(o));
        let value = p - o;
        Self {
            value,
            short: is_difference(value, p, o) && is_short(value),
        }
    }

    #[inline(always)]
    fn of(p: [f32; 3], o: [f32; 3]) -> [Self; 3] {
        [0, 1, 2].map(|k: usize| Self::new(p[k], o[k]))
    }
}

/// Whether the rounded difference of two numbers is their exact one: that of the larger number and the difference has no
/// error (Dekker 1971).
#[inline(always)]
fn is_difference(value: f64, p: f64, o: f64) -> bool {
    value + o == p && p - value == o
}

#[inline(always)]
fn is_short(x: f64) -> bool {
    #[expect(clippy::cast_possible_truncation, reason = "compared with the number")]
    let rounded = x as f32;
    f64::from(rounded) == x
}

/// Returns whether a ray certainly passes through a point: its direction is parallel to the way there.
#[inline(always)]
pub fn passes_through(o: [f32; 3], d: [f32; 3], p: [f32; 3]) -> bool {
    let way = Difference::of(p, o);
    [(0, 1), (1, 2), (2, 0)].into_iter().all(|(i, j)| {
        let exact = (d[j] == 0.0 || way[i].short) && (d[i] == 0.0 || way[j].short);
        exact && way[i].value * f64::from(d[j]) == way[j].value * f64::from(d[i])
    })
}

/// Returns the sign (-1, 0, 1) of `det[d, p - o, q - o]` if f64 computes it without rounding.
#[inline(always)]
pub fn edge_sign(o: [f32; 3], d: [f32; 3], [p, q]: [[f32; 3]; 2]) -> Option<i32> {
    let (way, side) = (Difference::of(p, o), Difference::of(q, p));
    let alone = d.iter().filter(|x| **x != 0.0).count() == 1;
    let mut terms = [0.0; 3];
    for (k, (i, j)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
        if d[k] == 0.0 {
            continue;
        }
        if !(way[i].short && way[j].short && side[i].short && side[j].short) {
            return None;
        }
        let (one, other) = (way[i].value * side[j].value, way[j].value * side[i].value);
        let minor = one - other;
        // Of one term only the sign matters.
        if !(alone || is_difference(minor, one, other) && is_short(minor)) {
            return None;
        }
        terms[k] = minor * f64::from(d[k]);
    }
    let [x, y, z] = terms;
    let sum = x + y;
    if !is_difference(sum, x, -y) {
        return None;
    }
    let all = sum + z;
    Some(i32::from(all > 0.0) - i32::from(all < 0.0))
}
