// SPDX-License-Identifier: GPL-3.0-or-later
//! The media that a ray is in: entered and left by the surfaces around them.

/// Largest number of media at one point; those entered beyond it are ignored until one is left.
pub const DEEPEST: usize = 8;

/// A medium inside an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inside {
    /// Material whose volume fills the object; [`Inside::WORLD`]'s is that of the background.
    pub material: u32,
    /// The object.
    pub object: u32,
    /// The triangle through which the ray entered, of which programs know the object.
    pub triangle: u32,
}

impl Inside {
    /// The medium of the background, which has no end.
    pub const WORLD: Self = Self {
        material: u32::MAX,
        object: u32::MAX,
        triangle: u32::MAX,
    };

    /// Whether this is the medium of the background.
    pub fn is_world(&self) -> bool {
        self.material == u32::MAX
    }

    /// Whether both are the same material in the same object.
    fn is(&self, other: &Self) -> bool {
        (self.material, self.object) == (other.material, other.object)
    }
}

/// The media that a ray is in.
#[derive(Debug, Clone, Copy)]
pub struct Stack {
    media: [Inside; DEEPEST],
    len: u8,
}

impl Default for Stack {
    /// Vacuum.
    fn default() -> Self {
        Self {
            media: [Inside::WORLD; DEEPEST],
            len: 0,
        }
    }
}

impl Stack {
    /// Returns the media, in the order in which they were entered.
    pub fn media(&self) -> &[Inside] {
        &self.media[..usize::from(self.len)]
    }

    /// Whether the ray is in no medium.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether this medium is entered.
    pub fn contains(&self, medium: &Inside) -> bool {
        self.media().iter().any(|m| m.is(medium))
    }

    /// Enters a medium, once only: objects whose surface lies double are not denser.
    pub fn enter(&mut self, medium: Inside) {
        if !self.contains(&medium) && usize::from(self.len) < DEEPEST {
            self.media[usize::from(self.len)] = medium;
            self.len += 1;
        }
    }

    /// Crosses the surface of an object, which may have a medium. `leaves`: whether the ray is inside of it.
    pub fn cross(&mut self, medium: Option<Inside>, leaves: bool) {
        match medium {
            Some(medium) if leaves => {
                self.leave(&medium);
            }
            Some(medium) => self.enter(medium),
            None => {}
        }
    }

    /// Leaves a medium, if it was entered. Returns whether it was.
    pub fn leave(&mut self, medium: &Inside) -> bool {
        let Some(at) = self.media().iter().position(|m| m.is(medium)) else {
            return false;
        };
        // Keep the order of the others, which decides the order of additions.
        let end = usize::from(self.len);
        self.media.copy_within(at + 1..end, at);
        self.len -= 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inside(material: u32, object: u32) -> Inside {
        Inside {
            material,
            object,
            triangle: 7,
        }
    }

    #[test]
    fn media_are_left_in_any_order_and_entered_once() {
        let mut stack = Stack::default();
        for object in [1, 2, 3, 2] {
            stack.enter(inside(0, object));
        }
        assert_eq!(stack.media().len(), 3);
        assert!(!stack.leave(&inside(1, 2)), "another material");
        assert!(stack.leave(&inside(0, 2)) && !stack.leave(&inside(0, 2)));
        let objects: Vec<u32> = stack.media().iter().map(|m| m.object).collect();
        assert_eq!(objects, [1, 3]);
    }

    #[test]
    fn too_many_media_are_ignored() {
        let mut stack = Stack::default();
        (0..20).for_each(|object| stack.enter(inside(0, object)));
        assert_eq!(stack.media().len(), DEEPEST);
        assert!(!stack.leave(&inside(0, 19)) && stack.leave(&inside(0, 0)));
    }
}
