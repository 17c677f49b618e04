// SPDX-License-Identifier: GPL-3.0-or-later
//! Compilation of programs: constants are folded, unused steps removed.

use crate::check::{Error, Result};
use crate::values::program::pure::pure;
use crate::values::program::{Operand, Program, Step, Value, finite_or_zero};

/// Length limit of a program, far above that of any useful node graph.
const MAX_STEPS: usize = 4096;

impl Program {
    /// Keeps the steps that `roots` depend on and that are not constant. `roots` become constants or registers of
    /// the kept steps; `name`: for messages.
    ///
    /// # Errors
    /// [`Error::Spec`] if a step has the wrong number of arguments or refers to a step that is not before it.
    pub fn compile(steps: &[Step], roots: &mut [Operand], name: &str) -> Result<Self> {
        if steps.len() > MAX_STEPS {
            return Err(Error::Spec(format!(
                "{name}: more than {MAX_STEPS} steps, got {}",
                steps.len()
            )));
        }
        // Fold constants, resolve the roots, and keep what they depend on.
        let (known, varying) = fold(steps, name)?;
        for root in roots.iter_mut() {
            *root = resolve(*root, &known).ok_or_else(|| {
                Error::Spec(format!("{name}: refers to a step that does not exist"))
            })?;
        }
        let used = used(&varying, roots);
        Ok(Self {
            steps: keep(varying, &used, roots),
        })
    }
}

/// Resolves an operand to a constant or a register; `None` if it refers to a later step. `known`: results of the
/// steps so far.
fn resolve(operand: Operand, known: &[Operand]) -> Option<Operand> {
    match operand {
        Operand::Register(r) => known.get(usize::from(r)).copied(),
        Operand::Value(v) => Some(Operand::Value(v.map(finite_or_zero))),
    }
}

/// Returns the result of each step, and the steps that have to be evaluated at each point (`None` if constant).
fn fold(steps: &[Step], name: &str) -> Result<(Vec<Operand>, Vec<Option<Step>>)> {
    let mut known: Vec<Operand> = Vec::with_capacity(steps.len());
    let mut varying = Vec::with_capacity(steps.len());
    for (i, step) in steps.iter().enumerate() {
        // Check the step's arguments.
        let wrong = |what: &str| Error::Spec(format!("{name}['program'][{i}]: {what}"));
        if step.args.len() != step.op.arity() {
            return Err(wrong(&format!(
                "expected {} arguments, got {}",
                step.op.arity(),
                step.args.len()
            )));
        }
        // Fold the step if its operation is pure and all its arguments are constants.
        let args: Option<Vec<_>> = step.args.iter().map(|&a| resolve(a, &known)).collect();
        let args = args.ok_or_else(|| wrong("refers to a later step"))?;
        let values = step.op.is_pure().then(|| constants(&args)).flatten();
        if let Some(values) = values {
            let value = pure(&step.op, |k| values[k]).map(finite_or_zero);
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

/// Returns the arguments if all are constants.
fn constants(args: &[Operand]) -> Option<Vec<Value>> {
    args.iter()
        .map(|a| match a {
            Operand::Value(v) => Some(*v),
            Operand::Register(_) => None,
        })
        .collect()
}

/// Returns which steps the roots depend on.
fn used(steps: &[Option<Step>], roots: &[Operand]) -> Vec<bool> {
    let mut used = vec![false; steps.len()];
    roots.iter().for_each(|&root| mark(root, &mut used));
    // Arguments precede their step, so one pass from the end reaches all of them.
    for i in (0..steps.len()).rev() {
        if used[i]
            && let Some(step) = &steps[i]
        {
            step.args.iter().for_each(|&a| mark(a, &mut used));
        }
    }
    used
}

/// Marks the step that an operand refers to.
fn mark(operand: Operand, used: &mut [bool]) {
    if let Operand::Register(r) = operand {
        used[usize::from(r)] = true;
    }
}

/// Returns the used steps, with all registers renumbered, including those of the roots.
fn keep(steps: Vec<Option<Step>>, used: &[bool], roots: &mut [Operand]) -> Vec<Step> {
    // Kept steps are numbered in order; a step refers only to earlier ones, which have their numbers.
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
