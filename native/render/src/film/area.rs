// SPDX-License-Identifier: GPL-3.0-or-later
//! The pixels of a tile and its division into blocks.

/// Side of a film tile in pixels; a multiple of [`BLOCK`].
pub(super) const TILE: u32 = 32;

/// Side of a block in pixels: camera rays are traced block by block, and adaptive sampling stops whole blocks.
pub const BLOCK: u32 = 8;

/// The rectangle of a tile's pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileArea {
    /// Left edge in the full frame.
    pub x: u32,
    /// Lower edge in the full frame.
    pub y: u32,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl TileArea {
    /// Returns the number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Returns the number of blocks per row and per column.
    pub fn blocks(&self) -> (u32, u32) {
        (self.width.div_ceil(BLOCK), self.height.div_ceil(BLOCK))
    }

    /// Returns the block of a pixel. Both are numbered row by row.
    #[inline]
    pub fn block_of(&self, pixel: usize) -> usize {
        let (x, y) = (pixel as u32 % self.width, pixel as u32 / self.width);
        (y / BLOCK * self.width.div_ceil(BLOCK) + x / BLOCK) as usize
    }

    /// Returns the pixels of the `active` blocks, block after block.
    pub fn in_blocks(&self, active: &[bool]) -> impl Iterator<Item = (u32, u32)> {
        // Ranges of the blocks along one side; the last one may be shorter.
        let side =
            |n: u32| (0..n.div_ceil(BLOCK)).map(move |b| (b * BLOCK, (b * BLOCK + BLOCK).min(n)));
        let width = self.width;
        side(self.height)
            .flat_map(move |rows| side(width).map(move |columns| (rows, columns)))
            .zip(active)
            .filter(|(_, active)| **active)
            .flat_map(|(((y0, y1), (x0, x1)), _)| {
                (y0..y1).flat_map(move |y| (x0..x1).map(move |x| (x, y)))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_visit_every_pixel_once_and_64_at_a_time() {
        let area = TileArea {
            x: 0,
            y: 0,
            width: 20,
            height: 11,
        };
        let order: Vec<_> = area.in_blocks(&[true; 6]).collect();
        let unique: std::collections::HashSet<_> = order.iter().collect();
        assert_eq!((order.len(), unique.len()), (220, 220));
        assert!(order[..64].iter().all(|&(x, y)| x < 8 && y < 8));
        let some = [false, false, true, false, true, false];
        let some: Vec<_> = area.in_blocks(&some).collect();
        assert_eq!(some.len(), 4 * 8 + 8 * 3);
        assert!(
            some.iter()
                .all(|&(x, y)| (x >= 16 && y < 8) || (8..16).contains(&x))
        );
        for (x, y) in order {
            assert_eq!(
                area.block_of((y * 20 + x) as usize) as u32,
                y / 8 * 3 + x / 8
            );
        }
    }
}
