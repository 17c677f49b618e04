// SPDX-License-Identifier: GPL-3.0-or-later
//! Determinants of integers: edge functions are such.

use crate::exact::long::Long;
use num_bigint::BigInt;
use std::ops::{Add, Sub};

/// Operations on sums of products that determinants need.
pub trait Number: Clone + Default + PartialOrd + Add<Output = Self> + Sub<Output = Self> {}

impl Number for Long {}
impl Number for BigInt {}

/// Integers whose products determinants add up.
pub trait Factor {
    /// Sums of products of two factors.
    type Minor: Sub<Output = Self::Minor>;
    /// Sums of products of three factors.
    type Sum: Number;

    /// Returns the product of two factors.
    fn times(&self, other: &Self) -> Self::Minor;

    /// Returns the product of this factor and a sum of products of two.
    fn scale(&self, sum: &Self::Minor) -> Self::Sum;
}

/// Sums do not overflow for factors below 2^62.
impl Factor for i64 {
    type Minor = i128;
    type Sum = Long;

    /// One multiplication of the processor, which cannot overflow.
    #[inline(always)]
    fn times(&self, other: &Self) -> i128 {
        i128::from(*self) * i128::from(*other)
    }

    #[inline(always)]
    fn scale(&self, sum: &i128) -> Long {
        Long::product(*self, *sum)
    }
}

impl Factor for BigInt {
    type Minor = Self;
    type Sum = Self;

    fn times(&self, other: &Self) -> Self {
        self * other
    }

    fn scale(&self, sum: &Self) -> Self {
        self * sum
    }
}

/// Returns the sign of a number: -1, 0 or 1.
pub fn sign<T: Number>(x: &T) -> i32 {
    let zero = T::default();
    i32::from(*x > zero) - i32::from(*x < zero)
}

/// Returns the edge function of a vertex, the weight of that vertex.
#[inline(always)]
pub fn weight<F: Factor>(d: &[F; 3], corners: &[[F; 3]; 3], vertex: usize) -> F::Sum {
    determinant(d, &corners[(vertex + 1) % 3], &corners[(vertex + 2) % 3])
}

/// Returns the three edge functions.
#[inline(always)]
pub fn weights<F: Factor>(d: &[F; 3], corners: &[[F; 3]; 3]) -> [F::Sum; 3] {
    [0, 1, 2].map(|vertex| weight(d, corners, vertex))
}

/// Returns the determinant of three rows.
#[inline(always)]
pub fn determinant<F: Factor>(a: &[F; 3], b: &[F; 3], c: &[F; 3]) -> F::Sum {
    let minor = |i: usize, j: usize| b[i].times(&c[j]) - b[j].times(&c[i]);
    a[0].scale(&minor(1, 2)) + a[1].scale(&minor(2, 0)) + a[2].scale(&minor(0, 1))
}
