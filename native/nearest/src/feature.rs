// SPDX-License-Identifier: GPL-3.0-or-later
//! The closest part of a triangle to a point, its distance and its closest point.
//!
//! The point lies over the face if the three edge functions of its projection are positive. Otherwise the closest
//! point is that of one of the edges, which are compared; this needs no case for triangles without area.

use crate::number::Number;

/// A vector in one of the arithmetics.
pub type Vector<N> = [N; 3];

/// A part of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feature {
    /// The vertex of this index.
    Vertex(usize),
    /// The inside of the edge opposite to the vertex of this index.
    Edge(usize),
    /// The inside of the face.
    Face,
}

/// A triangle as seen from a point.
#[derive(Debug, Clone)]
pub struct Seen<N> {
    /// The vertices relative to the point.
    pub corners: [Vector<N>; 3],
    /// The edges opposite to the vertices, in order around the triangle.
    pub sides: [Vector<N>; 3],
}

/// A quotient; the denominator is positive.
#[derive(Debug, Clone)]
pub struct Fraction<N> {
    /// The numerator.
    pub numerator: N,
    /// The denominator, `None` for 1.
    pub denominator: Option<N>,
}

impl<N: Number> Fraction<N> {
    /// Returns the sign of `self - other`, or `None` if it is not certain.
    #[inline(always)]
    pub fn order(&self, other: &Self) -> Option<i32> {
        let scaled = |a: &N, b: &Option<N>| b.as_ref().map_or_else(|| a.clone(), |b| a.times(b));
        let left = scaled(&self.numerator, &other.denominator);
        left.minus(&scaled(&other.numerator, &self.denominator))
            .sign()
    }
}

/// Returns the inner product.
#[inline(always)]
pub fn dot<N: Number>(a: &Vector<N>, b: &Vector<N>) -> N {
    (a[0].times(&b[0]))
        .plus(&a[1].times(&b[1]))
        .plus(&a[2].times(&b[2]))
}

/// Returns the vector product.
#[inline(always)]
pub fn cross<N: Number>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    let minor = |i: usize, j: usize| a[i].times(&b[j]).minus(&a[j].times(&b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// Returns the indices of the ends of the edge opposite to a vertex.
#[inline(always)]
pub fn ends(opposite: usize) -> (usize, usize) {
    ((opposite + 1) % 3, (opposite + 2) % 3)
}

impl<N: Number> Seen<N> {
    /// Returns a normal of the triangle, zero for one without area; its length is twice the area.
    #[inline(always)]
    pub fn normal(&self) -> Vector<N> {
        cross(&self.sides[0], &self.sides[1])
    }

    /// Returns the edge functions of the point's projection: the weights of the vertices.
    #[inline(always)]
    pub fn weights(&self, normal: &Vector<N>) -> [N; 3] {
        [0, 1, 2].map(|k| dot(normal, &cross(&self.corners[ends(k).0], &self.sides[k])))
    }

    /// Returns the part of an edge that is closest to the point.
    #[inline(always)]
    fn part_of_edge(&self, k: usize) -> Option<Feature> {
        let (i, j) = ends(k);
        if dot(&self.corners[i], &self.sides[k]).sign()? >= 0 {
            return Some(Feature::Vertex(i));
        }
        if dot(&self.corners[j], &self.sides[k]).sign()? <= 0 {
            return Some(Feature::Vertex(j));
        }
        Some(Feature::Edge(k))
    }

    /// Returns the closest part, or `None` if it is not certain.
    #[inline(always)]
    pub fn feature(&self) -> Option<Feature> {
        let signs = self.weights(&self.normal()).map(|weight| weight.sign());
        if signs == [Some(1); 3] {
            return Some(Feature::Face);
        }
        // The face is excluded if one weight is certainly not positive.
        if !signs.iter().any(|sign| sign.is_some_and(|sign| sign <= 0)) {
            return None;
        }
        self.closest_edge()
    }

    /// Returns the closest part of the boundary.
    #[inline(always)]
    pub fn closest_edge(&self) -> Option<Feature> {
        let mut best = self.part_of_edge(0)?;
        let mut least = self.squared(best);
        for k in 1..3 {
            let part = self.part_of_edge(k)?;
            if part == best {
                continue;
            }
            let squared = self.squared(part);
            if squared.order(&least)? < 0 {
                (best, least) = (part, squared);
            }
        }
        Some(best)
    }

    /// Returns the squared distance from a part on which the closest point lies.
    #[inline(always)]
    pub fn squared(&self, feature: Feature) -> Fraction<N> {
        let (numerator, denominator) = match feature {
            Feature::Vertex(k) => (dot(&self.corners[k], &self.corners[k]), None),
            Feature::Edge(k) => {
                let side = &self.sides[k];
                let moment = cross(&self.corners[ends(k).0], side);
                (dot(&moment, &moment), Some(dot(side, side)))
            }
            Feature::Face => {
                let normal = self.normal();
                let height = dot(&normal, &self.corners[0]);
                (height.times(&height), Some(dot(&normal, &normal)))
            }
        };
        Fraction {
            numerator,
            denominator,
        }
    }

    /// Returns the closest point relative to the point, as numerators and their common denominator, for a part on
    /// which it lies inside.
    #[inline(always)]
    pub fn offset(&self, feature: Feature) -> (Vector<N>, Option<N>) {
        match feature {
            Feature::Vertex(k) => (self.corners[k].clone(), None),
            Feature::Edge(k) => {
                // The part of the vector to the edge's beginning that is perpendicular to the edge.
                let side = &self.sides[k];
                let moment = cross(&self.corners[ends(k).0], side);
                (cross(side, &moment), Some(dot(side, side)))
            }
            Feature::Face => {
                let normal = self.normal();
                let height = dot(&normal, &self.corners[0]);
                let square = dot(&normal, &normal);
                (normal.map(|n| n.times(&height)), Some(square))
            }
        }
    }
}
