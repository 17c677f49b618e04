// SPDX-License-Identifier: GPL-3.0-or-later
//! The only list of structures. User interface, command line, tests, benchmark and documentation read these rows; a new
//! structure is one file in this room and one row here.

use crate::{bbox_gs, bih, bih_obl, brute, bsp, bvh_sah, grid, kd, kd_median, kd_sah, obb, octree};
use halfspace_base::error::{Error, Result};
use halfspace_structure::row::StructureSpec;
use halfspace_structure::spec::Config;

/// All structures, in the order in which lists show them.
pub const TREES: &[StructureSpec] = &[
    kd::SPEC,
    kd_sah::SPEC,
    kd_median::SPACE,
    kd_median::OBJECTS,
    bsp::fixed::PLAIN,
    bsp::fixed::KD,
    bsp::ize::PLAIN,
    bsp::ize::KD,
    bsp::random::PLAIN,
    bsp::random::PLUS,
    bsp::random::PLUS_KD,
    bsp::normals::PLAIN,
    bsp::normals::PLUS,
    bsp::normals::PLUS_KD,
    bsp::normals::AREA,
    bsp::clusters::PLAIN,
    bsp::clusters::PLUS,
    bsp::clusters::PLUS_KD,
    bsp::clusters::AXIAL,
    bsp::hybrid::SPEC,
    bsp::beam_hh::SPEC,
    bvh_sah::SPEC,
    obb::SPEC,
    bih::PLAIN,
    bih::SURFACE_AREA,
    bih::FIFTH_CASE,
    bih::ONE_PLANE,
    bih::FOUR_PLANES,
    bih::WIDE,
    bih::AS_BOXES,
    bih_obl::SPEC,
    bbox_gs::SPEC,
    bbox_gs::BRANCH_AND_BOUND,
    octree::PARAM,
    octree::ARVO,
    octree::NET,
    octree::BEAM,
    octree::SAMET,
    octree::GLASSNER,
    grid::SPEC,
    brute::SPEC,
];

/// Names that other authors gave to much the same tree.
const ALIASES: &[(&str, &str)] = &[("skd", "bih"), ("boxtree", "bih")];

/// The other names of a structure.
pub fn aliases(id: &str) -> impl Iterator<Item = &'static str> + use<'_> {
    ALIASES
        .iter()
        .filter(move |(_, own)| *own == id)
        .map(|(alias, _)| *alias)
}

/// The row of a structure, by its id or another name of it.
pub fn find(name: &str) -> Option<&'static StructureSpec> {
    let alias = ALIASES.iter().find(|(alias, _)| *alias == name);
    let id = alias.map_or(name, |(_, id)| id);
    TREES.iter().find(|tree| tree.id == id)
}

/// Reads a configuration string, `id` or `id:key=value,key=value`. Keys not given take their defaults.
///
/// # Errors
/// [`Error::Spec`] that names an unknown structure or key, a key given twice, or a value out of its range.
pub fn parse(text: &str) -> Result<Config> {
    let (id, rest) = text.trim().split_once(':').unwrap_or((text.trim(), ""));
    let structure = find(id).ok_or_else(|| {
        let known: Vec<_> = TREES.iter().map(|tree| tree.id).collect();
        Error::Spec(format!(
            "spec: unknown structure '{id}'; known are {}",
            known.join(", ")
        ))
    })?;
    Config::read(structure, rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_structure::row::Kind;
    use halfspace_structure::spec::Value;

    #[test]
    fn ids_and_codes_are_unique_and_defaults_lie_in_their_ranges() {
        for (i, tree) in TREES.iter().enumerate() {
            assert!(
                TREES[..i]
                    .iter()
                    .all(|t| t.id != tree.id && t.code != tree.code),
                "{}",
                tree.id
            );
            assert!(ALIASES.iter().all(|(alias, _)| *alias != tree.id));
            for param in tree.all_params() {
                let inside = match (param.kind, param.default) {
                    (Kind::Integer { min, max }, Value::Integer(x)) => (min..=max).contains(&x),
                    (Kind::Float { min, max }, Value::Float(x)) => (min..=max).contains(&x),
                    (kind, Value::Choice(x)) => {
                        kind.options().is_some_and(|options| options[0] == x)
                    }
                    _ => false,
                };
                assert!(inside, "{}: {}", tree.id, param.name);
                assert!(!param.full_doc().is_empty() && !param.label.is_empty());
            }
        }
        assert!(
            ALIASES
                .iter()
                .all(|(alias, id)| find(alias).is_some_and(|tree| tree.id == *id))
        );
    }

    #[test]
    fn specs_read_and_write() {
        let config = parse(" kd:traversal=dir, max_depth=20 ").unwrap();
        assert_eq!(
            (config.choice("traversal"), config.integer("max_depth")),
            ("dir", 20)
        );
        assert_eq!(config.canonical(), "kd:traversal=dir,max_depth=20");
        assert_eq!(parse("kd").unwrap().canonical(), "kd");
        assert_eq!(parse("kd:traversal=auto").unwrap().canonical(), "kd");
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part) in [
            ("tree", "unknown structure 'tree'"),
            ("kd:colour=red", "'kd' has no key 'colour'"),
            (
                "kd:max_depth=61",
                "max_depth=61 is not a whole number from 0 to 60",
            ),
            ("kd:step_cost=nan", "step_cost=nan is not a number"),
            (
                "kd:traversal=fast",
                "traversal=fast is not one of auto, dir",
            ),
            ("kd:max_depth", "'max_depth' in 'kd' should read key=value"),
            (
                "kd:traversal=dir,max_depth=9,traversal =dir",
                "spec: traversal is given twice in 'kd'",
            ),
            ("", "unknown structure ''"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}
