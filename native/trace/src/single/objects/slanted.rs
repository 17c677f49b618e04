// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through interval hierarchies along thirteen directions.

use crate::batch;
use crate::pending::{Pending, next};
use crate::single::objects::dops::Planes;
use crate::single::single_rays;
use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slant_tree::{SlantKind, SlantTree};
use halfspace_nodes::slanted_tree::DIRECTIONS;
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{Hit, RayRef};

/// The traversal of one tree.
pub struct Walk<'a>(pub &'a SlantTree);

impl batch::Walk for Walk<'_> {
    type Scratch = [Pending; MAX_DEPTH + 1];

    fn scratch(&self) -> Self::Scratch {
        [Pending::default(); MAX_DEPTH + 1]
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
        stack: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let nodes = &self.0.nodes[..];
        let slabs = Planes::<DIRECTIONS>::new(frame);
        let mut best = Best::new(frame);
        let mut waiting = 0;
        let mut node = nodes[0];
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        loop {
            match node.kind() {
                SlantKind::Inner {
                    direction,
                    alone,
                    planes,
                    link,
                } => {
                    if direction < 3 {
                        counters.step_boxes();
                    } else {
                        counters.step_oblique();
                    }
                    // An only child is entered through the plane where the near one of two children would be
                    // left.
                    let side = usize::from(slabs.flip(direction));
                    let (near, far) = if alone {
                        (planes[side ^ 1], planes[side])
                    } else {
                        (planes[side], planes[side ^ 1])
                    };
                    let ends = keep_min(slabs.latest(direction, near), leave);
                    let begins = keep_max(slabs.soonest(direction, far), enter);
                    // Visit the near child if the ray enters before it ends, the far one if that begins in
                    // time.
                    if alone {
                        (enter, leave) = (begins, ends);
                        if enter <= leave {
                            node = nodes[link as usize];
                            continue;
                        }
                    } else {
                        let far = link as usize + (side ^ 1);
                        if enter <= ends {
                            if begins <= leave {
                                stack[waiting] = Pending {
                                    node: u32::try_from(far).expect("a link"),
                                    enter: begins,
                                    leave,
                                };
                                waiting += 1;
                            }
                            leave = ends;
                            node = nodes[link as usize + side];
                            continue;
                        }
                        if begins <= leave {
                            enter = begins;
                            node = nodes[far];
                            continue;
                        }
                    }
                }
                SlantKind::Leaf { first, count } => {
                    counters.leaf(count);
                    if job.test_any::<S, Q, C>(
                        simd,
                        Leaf { first, count },
                        RayRef { ray, frame },
                        leave,
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            let Some(child) = next(stack, &mut waiting, best.reach) else {
                return best.hit();
            };
            let place;
            (place, enter, leave) = child.within(best.reach);
            node = nodes[place as usize];
        }
    }
}

single_rays! {
    /// Single rays through intervals along any of thirteen directions.
    fn slanted(SlantTree) -> Walk<'a> {
        |kernel| Walk(&kernel.tree)
    }
}
