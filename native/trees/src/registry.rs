// SPDX-License-Identifier: GPL-3.0-or-later
//! The only list of structures. User interface, command line, tests, benchmark and documentation read these rows; a new
//! structure is one file in this room and one row here.

use crate::{
    bbox_gs, bih, bih_obl, brute, bsp, bvh_hlbvh, bvh_ploc, bvh_sah, grid, kd, kd_median, kd_sah,
    obb, octree,
};
use halfspace_base::error::{Error, Result};
use halfspace_structure::effective::Effective;
use halfspace_structure::row::StructureSpec;
use halfspace_structure::spec::Config;
use std::borrow::Cow;

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
    bvh_ploc::SPEC,
    bvh_hlbvh::SPEC,
    obb::SPEC,
    bih::PLAIN,
    bih::SURFACE_AREA,
    bih::FIFTH_CASE,
    bih::ONE_PLANE,
    bih::WIDE,
    bih::AS_BOXES,
    bih_obl::SPEC,
    bbox_gs::SPEC,
    bbox_gs::BRANCH_AND_BOUND,
    octree::PARAM,
    octree::NET,
    octree::BEAM,
    octree::SAMET,
    octree::GLASSNER,
    grid::SPEC,
    brute::SPEC,
];

/// Another name of a structure.
#[derive(Debug, Clone, Copy)]
pub struct Alias {
    /// The name.
    pub name: &'static str,
    /// The id of the structure.
    pub id: &'static str,
    /// The parameters that the name sets, as `key=value,...`; empty for the defaults.
    pub given: &'static str,
}

/// Names that other authors gave to much the same tree.
const ALIASES: &[Alias] = &[
    alias("skd", "bih", ""),
    alias("boxtree", "bih", ""),
    alias("bih4", "bih-n", "n=2"),
    alias("octree-arvo", "octree-param", ""),
];

const fn alias(name: &'static str, id: &'static str, given: &'static str) -> Alias {
    Alias { name, id, given }
}

/// The other names of a structure.
pub fn aliases(id: &str) -> impl Iterator<Item = &'static Alias> + use<'_> {
    ALIASES.iter().filter(move |alias| alias.id == id)
}

/// The row of a structure, by its id.
pub fn find(id: &str) -> Option<&'static StructureSpec> {
    TREES.iter().find(|tree| tree.id == id)
}

/// Reads a configuration string, `id` or `id:key=value,key=value`. Keys not given take their defaults.
///
/// # Errors
/// [`Error::Spec`] that names an unknown structure or key, a key given twice, or a value out of its range.
pub fn parse(text: &str) -> Result<Config> {
    let (structure, rest) = split(text)?;
    Config::read(structure, &rest)
}

/// Reads a configuration that may contradict itself: each parameter of its structure with its effective value.
///
/// # Errors
/// [`Error::Spec`] that names an unknown structure or key, or text that is no number where one is expected.
pub fn effective(text: &str) -> Result<Vec<Effective>> {
    let (structure, rest) = split(text)?;
    halfspace_structure::effective::effective(structure, &rest)
}

/// Splits a configuration into the row of its structure and its parameters, with those that another name sets.
fn split(text: &str) -> Result<(&'static StructureSpec, Cow<'_, str>)> {
    let (id, rest) = text.trim().split_once(':').unwrap_or((text.trim(), ""));
    let alias = ALIASES.iter().find(|alias| alias.name == id);
    let rest = match alias.map_or("", |alias| alias.given) {
        "" => Cow::Borrowed(rest),
        given if rest.trim().is_empty() => Cow::Borrowed(given),
        given => Cow::Owned(format!("{given},{rest}")),
    };
    let structure = find(alias.map_or(id, |alias| alias.id)).ok_or_else(|| {
        let known: Vec<_> = TREES.iter().map(|tree| tree.id).collect();
        Error::Spec(format!(
            "spec: unknown structure '{id}'; known are {}",
            known.join(", ")
        ))
    })?;
    Ok((structure, rest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_structure::row::{Kind, Only, ParamSpec};
    use halfspace_structure::spec::Value;
    use halfspace_structure::way::{NODES, Rays, TRAVERSAL};

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
            assert!(ALIASES.iter().all(|alias| alias.name != tree.id));
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
        for alias in ALIASES {
            let spelled = format!("{}:{}", alias.id, alias.given);
            let (own, other) = (parse(alias.name).unwrap(), parse(&spelled).unwrap());
            assert_eq!(own.canonical(), other.canonical());
            assert!(find(alias.id).is_some());
        }
        let config = parse("bih4:leaf_size=2").unwrap();
        assert_eq!(config.canonical(), "bih-n:n=2,leaf_size=2");
        assert!(parse("bih4:n=8").is_err());
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

    /// Packets, tiles and streams go through each kind of nodes, or the row gives the reason why they do not.
    #[test]
    fn groups_go_through_all_nodes_or_a_reason_is_given() {
        let mut alone = 0;
        for tree in TREES {
            for nodes in tree.ways.iter().map(|way| way.nodes) {
                let offered = [Rays::Packet, Rays::Tile, Rays::Stream].map(|rays| {
                    let mut ways = tree.ways.iter();
                    ways.any(|way| way.nodes == nodes && way.rays == rays)
                });
                let wanted = [tree.no_groups.is_empty(); 3];
                assert_eq!(offered, wanted, "{} through {nodes}", tree.id);
            }
            alone += usize::from(!tree.no_groups.is_empty());
        }
        assert!(alone < TREES.len() / 4, "{alone} trees without groups");
    }

    #[test]
    fn every_way_is_chosen_by_its_spelling() {
        for tree in TREES {
            for (way, spelled) in tree.ways.iter().zip(tree.spelled_ways()) {
                let config = parse(&spelled).unwrap();
                assert_eq!(config.way(), way, "{spelled}");
                assert_eq!(parse(&config.canonical()).unwrap().way(), way, "{spelled}");
            }
            let nodes = tree.params.iter().find(|p| p.name == NODES);
            for option in nodes.and_then(|p| p.kind.options()).unwrap_or_default() {
                let usual = parse(&format!("{}:nodes={option}", tree.id)).unwrap();
                assert_eq!(usual.way().nodes, option, "{}", tree.id);
                assert!(!usual.canonical().contains(TRAVERSAL), "{}", tree.id);
            }
        }
    }

    #[test]
    fn conditions_name_parameters_and_options_that_exist() {
        for tree in TREES {
            let all: Vec<_> = tree.all_params().collect();
            let of_options = |param: &&ParamSpec| match param.kind {
                Kind::Choice(options) => options.iter().flat_map(|option| option.needs).collect(),
                _ => Vec::new(),
            };
            let needs = all.iter().flat_map(|param| param.needs);
            let needs = needs.chain(all.iter().flat_map(of_options));
            for need in needs {
                let other = all.iter().find(|param| param.name == need.key);
                let other = other.unwrap_or_else(|| panic!("{}: {need}", tree.id));
                let known = match need.only {
                    Only::Options(names) => {
                        let options = other.kind.options().unwrap();
                        names.iter().all(|name| options.contains(name))
                    }
                    Only::Above(_) => other.kind.options().is_none(),
                };
                assert!(known, "{}: {need}", tree.id);
            }
        }
    }

    fn value_of(text: &str, name: &str) -> Option<Value> {
        let params = effective(text).unwrap();
        params
            .iter()
            .find(|one| one.param.name == name)
            .unwrap()
            .value
    }

    /// The values in effect are those of the configuration that is built, where it can be built.
    #[test]
    fn effective_values_are_those_of_a_configuration() {
        for spelled in TREES.iter().flat_map(StructureSpec::spelled_ways) {
            let config = parse(&spelled).unwrap();
            for one in effective(&spelled).unwrap() {
                let value = one.value.unwrap_or(*config.find(one.param.name).unwrap());
                assert_eq!(config.find(one.param.name), Some(&value), "{spelled}");
                if let Value::Choice(option) = value {
                    assert!(one.options.contains(&option), "{spelled}: {option}");
                }
            }
        }
    }

    #[test]
    fn effective_values_replace_and_ignore_what_a_configuration_must_not_have() {
        for (text, name, value) in [
            ("kd", "step_cost", Some(Value::Float(20.0))),
            ("kd:max_depth=9000", "max_depth", Some(Value::Integer(60))),
            (
                "kd:traversal=never",
                "traversal",
                Some(Value::Choice("auto")),
            ),
            (
                "kd:nodes=wide,traversal=sung",
                "traversal",
                Some(Value::Choice("auto")),
            ),
            (
                "kd:nodes=boxes,shadow=beam",
                "shadow",
                Some(Value::Choice("none")),
            ),
            (
                "kd:nodes=planes,shadow=beam",
                "shadow",
                Some(Value::Choice("beam")),
            ),
            ("kd:nodes=boxes,lazy=1", "lazy", None),
            ("bsp-wn-plus-kd:costs=thesis,step_cost=3", "step_cost", None),
            ("bsp-wn-plus-kd:k=3,alpha=2", "alpha", None),
            (
                "bvh-sah:width=4,traversal=packet8",
                "traversal",
                Some(Value::Choice("auto")),
            ),
        ] {
            assert_eq!(value_of(text, name), value, "{text}: {name}");
        }
        for (text, name, other) in [
            (
                "bsp-wn-plus-kd:costs=thesis,step_cost=3",
                "step_cost",
                "costs",
            ),
            ("kd:nodes=boxes,shadow=beam", "shadow", "nodes"),
            ("rbsp:seed=3", "seed", "set"),
        ] {
            let params = effective(text).unwrap();
            let idle = params
                .iter()
                .filter_map(|one| Some((one.param.name, one.unmet?.key)));
            assert_eq!(idle.collect::<Vec<_>>(), [(name, other)], "{text}");
        }
        for (text, part) in [
            ("tree", "unknown structure 'tree'"),
            ("kd:colour=red", "'kd' has no key 'colour'"),
            ("kd:step_cost=x", "step_cost=x is not a number"),
        ] {
            let message = effective(text).unwrap_err().to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }

    #[test]
    fn names_in_the_literature_are_configurations() {
        for tree in TREES {
            assert!(!tree.literature.is_empty(), "{}", tree.id);
            for (name, parameters) in tree.literature {
                let config = Config::read(tree, parameters);
                assert!(config.is_ok() && !name.is_empty(), "{}: {name}", tree.id);
            }
        }
        let swept = TREES.iter().filter(|tree| tree.sweep);
        assert!(swept.clone().all(|tree| tree.id.starts_with("bsp-")));
        assert_eq!(swept.count(), 12);
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
            (
                "kd:nodes=boxes,traversal=ta-a",
                "no traversal=ta-a through nodes=boxes; nodes=boxes has auto, ordered, flight, stream, tile, tile16, \
                 packet, packet8, packet4, and traversal=ta-a needs nodes=planes",
            ),
            (
                "kd:traversal=ordered",
                "no traversal=ordered through nodes=planes",
            ),
            (
                "kd:nodes=boxes,shadow=beam",
                "shadow=beam needs nodes=planes in 'kd', got nodes=boxes",
            ),
            (
                "bsp-wn-plus-kd:costs=thesis,step_cost=3",
                "step_cost=3 has no effect in 'bsp-wn-plus-kd' with costs=thesis; it needs costs=fitted",
            ),
            (
                "bsp-wn-plus-kd:k=3,alpha=2",
                "alpha=2 has no effect in 'bsp-wn-plus-kd' with k=3; it needs k above 3",
            ),
            (
                "bvh-sah:width=4,traversal=packet8",
                "width=4 has no effect in 'bvh-sah' with traversal=packet8",
            ),
            ("bsp-wn:step_cost=3", "'bsp-wn' has no key 'step_cost'"),
            (
                "kd:leaves=scalar,traversal=tile",
                "leaves=scalar needs traversal=auto|dir|ta-b|ta-a|sung|arvo|seq|rope|ropetree in 'kd', got traversal=tile",
            ),
            (
                "bsp-wn:leaves=scalar,nodes=wide",
                "leaves=scalar needs nodes=planes in 'bsp-wn', got nodes=wide",
            ),
            (
                "kd:leaves=scalar,shadow=beam",
                "leaves=scalar needs shadow=none|cache in 'kd', got shadow=beam",
            ),
            (
                "kd:lazy=1,leaves=scalar",
                "lazy=1 has no effect in 'kd' with leaves=scalar; it needs leaves=blocks",
            ),
            ("beam-hh:leaves=scalar", "'beam-hh' has no key 'leaves'"),
            ("bsp-random:draw=thesis", "'bsp-random' has no key 'draw'"),
            (
                "bsp-cn-plus-kd:k=3,draw=thesis",
                "draw=thesis has no effect in 'bsp-cn-plus-kd' with k=3; it needs k above 3",
            ),
            (
                "bsp-cn:empty_clusters=code",
                "empty_clusters=code has no effect in 'bsp-cn' with draw=distinct; it needs draw=thesis",
            ),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}
