// SPDX-License-Identifier: GPL-3.0-or-later
//! Programs from the steps of a node graph: what does not vary is computed once, and what nobody uses
//! is left out.

use super::super::check::{Error, Result};
use super::pure::pure;
use super::{Operand, Program, Step, Value, tame};

/// Longest program: what is longer is a slip.
const MOST_STEPS: usize = 4096;

impl Program {
    /// Keeps the steps that `roots` need and whose value varies; `roots` are renumbered or become
    /// constants.
    ///
    /// # Errors
    /// When a step has the wrong number of arguments, or takes a result that is not there yet.
    pub fn compile(steps: &[Step], roots: &mut [Operand], name: &str) -> Result<Self> {
        if steps.len() > MOST_STEPS {
            return Err(Error::Spec(format!(
                "{name}: more than {MOST_STEPS} steps, got {}",
                steps.len()
            )));
        }
        let (known, varying) = fold(steps, name)?;
        for root in roots.iter_mut() {
            *root = resolve(*root, &known)
                .ok_or_else(|| Error::Spec(format!("{name}: takes a step that is not there")))?;
        }
        let used = used(&varying, roots);
        Ok(Self {
            steps: keep(varying, &used, roots),
        })
    }
}

/// What an operand comes to, after the steps whose results are `known`; `None` for a later one's.
fn resolve(operand: Operand, known: &[Operand]) -> Option<Operand> {
    match operand {
        Operand::Register(r) => known.get(usize::from(r)).copied(),
        Operand::Value(v) => Some(Operand::Value(v.map(tame))),
    }
}

/// The result of each step, and those steps that have to be computed at each place.
fn fold(steps: &[Step], name: &str) -> Result<(Vec<Operand>, Vec<Option<Step>>)> {
    let mut known: Vec<Operand> = Vec::with_capacity(steps.len());
    let mut varying = Vec::with_capacity(steps.len());
    for (i, step) in steps.iter().enumerate() {
        let wrong = |what: &str| Error::Spec(format!("{name}['program'][{i}]: {what}"));
        if step.args.len() != step.op.arity() {
            return Err(wrong(&format!(
                "expected {} arguments, got {}",
                step.op.arity(),
                step.args.len()
            )));
        }
        let args: Option<Vec<_>> = step.args.iter().map(|&a| resolve(a, &known)).collect();
        let args = args.ok_or_else(|| wrong("takes the result of a later step"))?;
        let values = step.op.is_pure().then(|| constants(&args)).flatten();
        if let Some(values) = values {
            let value = pure(&step.op, |k| values[k]).map(tame);
            known.push(Operand::Value(value));
            varying.push(None);
        } else {
            known.push(Operand::Register(i as u16));
            varying.push(Some(Step {
                op: step.op.clone(),
                args,
            }));
        }
    }
    Ok((known, varying))
}

/// The arguments, if all are the same everywhere.
fn constants(args: &[Operand]) -> Option<Vec<Value>> {
    args.iter()
        .map(|a| match a {
            Operand::Value(v) => Some(*v),
            Operand::Register(_) => None,
        })
        .collect()
}

/// Which steps the roots need.
fn used(steps: &[Option<Step>], roots: &[Operand]) -> Vec<bool> {
    let mut used = vec![false; steps.len()];
    roots.iter().for_each(|&root| mark(root, &mut used));
    for i in (0..steps.len()).rev() {
        if used[i]
            && let Some(step) = &steps[i]
        {
            step.args.iter().for_each(|&a| mark(a, &mut used));
        }
    }
    used
}

fn mark(operand: Operand, used: &mut [bool]) {
    if let Operand::Register(r) = operand {
        used[usize::from(r)] = true;
    }
}

/// The used steps one after another, with all registers renumbered, those of the roots too.
fn keep(steps: Vec<Option<Step>>, used: &[bool], roots: &mut [Operand]) -> Vec<Step> {
    let mut numbers = vec![0_u16; steps.len()];
    let mut kept = Vec::new();
    let renumber = |operand: &mut Operand, numbers: &[u16]| {
        if let Operand::Register(r) = operand {
            *r = numbers[usize::from(*r)];
        }
    };
    for (i, step) in steps.into_iter().enumerate() {
        if let (true, Some(mut step)) = (used[i], step) {
            step.args.iter_mut().for_each(|a| renumber(a, &numbers));
            numbers[i] = kept.len() as u16;
            kept.push(step);
        }
    }
    roots.iter_mut().for_each(|r| renumber(r, &numbers));
    kept
}
