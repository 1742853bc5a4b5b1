//! The first pass of [`super::fuse::fuse`]: a sine that is written in many operations is written in fewer fused ones.
//!
//! Without fused multiply-adds a sine takes the reduction by π/2 in four parts, and both sine and cosine of what remains. With
//! them x − nπ is exact in one operation, and so is what a square or a sum loses: one polynomial on [−π/2, π/2] is enough, with
//! an error below that of the longer form.
//!
//! A function is found by its operations, whatever their order, and replaced where it is of something that depends on the state
//! and where nothing else reads a value within it. So sine and cosine of one angle stay as they are: together they cost little
//! more than one of them. The operations are in `forms_table.rs`, which `docs/forms.py` writes from the specification,
//! `reference/tape/forms.py`.

use super::{Id, Op, Tape, forms_table::FORMS, uses::UseCounts};

/// Rewrites functions in their quick forms. Returns the new tape and the new ids of the roots.
pub(super) fn in_quick_forms(tape: &Tape, roots: &[Id]) -> (Tape, Vec<Id>) {
    let uses = UseCounts::new(tape, roots);
    let mut made = Tape { written: tape.written, series: tape.series, ..Tape::new(tape.precision()) };
    let mut place = vec![0; tape.ops().len()];
    for (id, op) in tape.ops().iter().enumerate().filter(|(id, _)| uses.needed[*id]) {
        place[id] = match quick(tape, &uses, id as Id) {
            Some((x, ops)) => {
                let mut of = vec![place[x as usize]];
                for op in &ops[1..] {
                    of.push(made.put(op.with(|id| of[id as usize])));
                }
                of[of.len() - 1]
            }
            None => made.put(op.with(|id| place[id as usize])),
        };
    }
    let roots = roots.iter().map(|root| place[*root as usize]).collect();
    (made, roots)
}

/// The argument and the quick form, if a value is a function that is replaced.
fn quick(tape: &Tape, uses: &UseCounts, id: Id) -> Option<(Id, &'static [Op])> {
    FORMS
        .iter()
        .find_map(|form| {
            let root = form.plain.len() - 1;
            if tape.op(id).name() != form.plain[root].name() {
                return None;
            }
            let mut bound = vec![None; form.plain.len()];
            (fits(form.plain, root as Id, tape, id, &mut bound) && is_apart(form.plain, &bound, &uses.reads))
                .then_some((bound[0]?, form.quick))
        })
        .filter(|(x, _)| tape.is_of_state(*x))
}

/// Whether a value is that of a form, and all it is made of as well: `bound` has the value of each operation of the form.
fn fits(form: &[Op], of_form: Id, tape: &Tape, id: Id, bound: &mut Vec<Option<Id>>) -> bool {
    let at = of_form as usize;
    if let Some(known) = bound[at] {
        return known == id;
    }
    let (wanted, op) = (form[at], tape.op(id));
    if let Op::State(_) = wanted {
        bound[at] = Some(id);
        return true;
    }
    if (wanted.name(), wanted.extra()) != (op.name(), op.extra()) {
        return false;
    }
    let ((of, n), ([a, b, c], _)) = (wanted.operands(), op.operands());
    let orders = [[a, b, c], [b, a, c]];
    for order in &orders[..if wanted.commutes() { 2 } else { 1 }] {
        let before = bound.clone();
        bound[at] = Some(id);
        if (0..n).all(|i| fits(form, of[i], tape, order[i], bound)) {
            return true;
        }
        *bound = before;
    }
    false
}

/// Whether nothing but the form reads a value within it.
fn is_apart(form: &[Op], bound: &[Option<Id>], reads: &[u32]) -> bool {
    let mut within = vec![0; form.len()];
    for op in form {
        let (of, n) = op.operands();
        of[..n].iter().for_each(|of| within[*of as usize] += 1);
    }
    let inner = (0..form.len() - 1).filter(|at| !form[*at].is_leaf());
    inner.into_iter().all(|at| bound[at].is_some_and(|id| reads[id as usize] == within[at]))
}
