//! Block schedules: the order of the operations of a program over the rows of an arena.
//!
//! A program says which block is computed from which. Between two rates it only adds and multiplies, elementwise, so all of that
//! is one pass over the rows: it is traced into a tape whose state is the arena, a number for each row, and becomes a kernel like
//! any other. A block is kept in a row only if a rate reads it, if it is a result, or if it would be expensive to compute again.
//! A row is reused as soon as its block is not read any more; the new state is written straight into the rows of the old one
//! where that is so.

use std::collections::BTreeSet;

use super::rates::RateTraits;
use crate::{
    model::{
        program::{Block, Entry, Program, Time},
        system::Shape,
    },
    stage::Stage,
    tape::{Id, Op, Tape, split::split},
};

/// Operations from which on it is faster to keep a block in a row than to compute it again.
const MIN_OPERATIONS_PER_ROW: usize = 4;

/// The row of the velocities, at the start of the step and, if it is the state that is changed, at its end. Behind both rows of
/// the state are those of the blocks that the method keeps beside it.
pub(crate) const V: usize = 0;
/// The row of the coordinates, likewise.
pub(crate) const Y: usize = 1;

/// A rate, or another request of a schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// h·v̇
    Dv,
    /// h·ẏ
    Dy,
    /// The velocity of an increment of y.
    Velocity,
    /// The solution of the equations of an implicit step, its block of v.
    SolutionV,
    /// Likewise of y.
    SolutionY,
    /// h times the derivative of h·v̇ by the time, at the start of the step.
    ByTimeV,
    /// Likewise of y.
    ByTimeY,
    /// The sum of the squares of both blocks, at each place of a block of v.
    SquareV,
    /// Likewise of y.
    SquareY,
}

/// One action of a schedule.
pub enum Action {
    /// A rate, from two rows into another. Of [`Rate::Velocity`] the increment is in the row `y`.
    Ask {
        /// The requested rate.
        rate: Rate,
        /// The time in the step.
        at: Time,
        /// Row of the velocities.
        v: usize,
        /// Row of the coordinates.
        y: usize,
        /// Row of the result.
        out: usize,
    },
    /// Both rates of one state.
    Both {
        /// The time in the step.
        at: Time,
        /// Rows of the state.
        state: [usize; 2],
        /// Rows of the results.
        out: [usize; 2],
    },
    /// The equations of the step, from the state at its start.
    Derive,
    /// The solution of the equations, from the rows of right-hand sides.
    Solve([usize; 2]),
    /// One pass over the rows.
    Pass(Box<Stage>),
}

/// The schedule for an arena.
pub struct BlockSchedule {
    /// The actions, in order.
    pub actions: Vec<Action>,
    /// How many rows the arena has.
    pub rows: usize,
    /// The rows of the results.
    pub results: Vec<usize>,
}

/// The purpose of a schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// The first two results replace the state, the others the blocks that are kept beside it.
    State,
    /// The state stays, and rates are those of a system scaled to a step of 1, stretched to the step.
    Attempt,
}

#[derive(Clone, Copy, Debug)]
enum Node {
    /// The content of a row at the start.
    Start(usize),
    Ask(Rate, Time, usize, usize),
    Add(usize, usize),
    Sub(usize, usize),
    Scale(f64, usize),
    /// The third where the first is at most the second, else the fourth.
    IfAtMost([usize; 4]),
    /// The step times it.
    TimesStep(usize),
    /// It divided by the step.
    PerStep(usize),
    /// The length of the attempt times it.
    Stretched(usize),
}

impl Node {
    fn operands(self) -> impl Iterator<Item = usize> {
        let (list, n) = match self {
            Node::Start(_) => ([0; 4], 0),
            Node::Scale(_, a) | Node::TimesStep(a) | Node::PerStep(a) | Node::Stretched(a) => ([a, 0, 0, 0], 1),
            Node::Ask(_, _, a, b) | Node::Add(a, b) | Node::Sub(a, b) => ([a, b, 0, 0], 2),
            Node::IfAtMost(all) => (all, 4),
        };
        list.into_iter().take(n)
    }

    /// Whether it is there without a pass.
    fn is_given(self) -> bool {
        matches!(self, Node::Start(_) | Node::Ask(..))
    }
}

/// Pass k comes before the rates of turn k, which are independent of each other; the last pass computes the results.
struct PassPlan {
    nodes: Vec<Node>,
    results: Vec<usize>,
    /// For each node that is asked for, its turn.
    turn: Vec<Option<usize>>,
    /// The nodes that each pass writes.
    writes: Vec<BTreeSet<usize>>,
    /// For each node the pass that writes it.
    pass: Vec<Option<usize>>,
}

impl BlockSchedule {
    /// Operations of all passes.
    pub(crate) fn size(&self) -> usize {
        let passes =
            self.actions.iter().filter_map(|action| if let Action::Pass(stage) = action { Some(stage.size()) } else { None });
        passes.sum::<usize>()
    }

    /// The schedule for blocks of that shape; blocks of no numbers are left alone.
    pub fn new(program: &Program, results: &[Block], goal: Goal, traits: RateTraits, shape: Shape) -> BlockSchedule {
        let mut plan = PassPlan::new(program, results, goal, traits, shape);
        plan.keep_expensive();
        plan.place(goal)
    }
}

impl PassPlan {
    fn new(program: &Program, results: &[Block], goal: Goal, traits: RateTraits, shape: Shape) -> PassPlan {
        let kept = if goal == Goal::State { results.len().saturating_sub(2) } else { 0 };
        let mut nodes: Vec<Node> = (0..2 + kept).map(Node::Start).collect();
        // Of each block its node, and whether it is one of velocities.
        let mut made: Vec<(usize, bool)> = Vec::with_capacity(program.entries.len());
        for entry in &program.entries {
            let of = |block: Block| made[block.index()].0;
            let (node, of_v) = match *entry {
                Entry::V => (Node::Start(V), true),
                Entry::Y => (Node::Start(Y), false),
                Entry::Kept(i, of_v) => (Node::Start(2 + i as usize), of_v),
                Entry::Dv(at, v, y) => (Node::Ask(Rate::Dv, at, if traits.reads_v { of(v) } else { V }, of(y)), true),
                Entry::Dy(_, v, _) if traits.second_order => (Node::TimesStep(of(v)), false),
                Entry::Dy(at, v, y) => (Node::Ask(Rate::Dy, at, of(v), of(y)), false),
                // A system with a splitting of its own is one tape (`tapes.rs`): here a kick is h·v̇, and a drift is free flight.
                Entry::Kick(at, v, y) => (Node::Ask(Rate::Dv, at, if traits.reads_v { of(v) } else { V }, of(y)), true),
                Entry::DriftV(_, v, _) => {
                    made.push(made[v.index()]);
                    continue;
                }
                Entry::DriftY(share, v, y) => {
                    let dy =
                        if traits.second_order { Node::TimesStep(of(v)) } else { Node::Ask(Rate::Dy, Time::START, of(v), of(y)) };
                    nodes.push(dy);
                    if share != 1.0 {
                        nodes.push(Node::Scale(share, nodes.len() - 1));
                    }
                    (Node::Add(of(y), nodes.len() - 1), false)
                }
                Entry::Velocity(d) if traits.second_order => (Node::PerStep(of(d)), true),
                Entry::Velocity(d) => (Node::Ask(Rate::Velocity, Time::START, V, of(d)), true),
                Entry::Add(a, b) => (Node::Add(of(a), of(b)), made[a.index()].1),
                Entry::Sub(a, b) => (Node::Sub(of(a), of(b)), made[a.index()].1),
                Entry::Scale(c, a) => (Node::Scale(c, of(a)), made[a.index()].1),
                // Steps with a series are refused where they are too long for one tape (`trace.rs`), so this is never executed.
                Entry::SeriesV(_, v, y) => (Node::Ask(Rate::Dv, Time::START, of(v), of(y)), true),
                Entry::SeriesY(_, v, y) => (Node::Ask(Rate::Dy, Time::START, of(v), of(y)), false),
                Entry::ImplicitV(_, v, y) => (Node::Ask(Rate::SolutionV, Time::START, of(v), of(y)), true),
                Entry::ImplicitY(_, v, y) => (Node::Ask(Rate::SolutionY, Time::START, of(v), of(y)), false),
                Entry::ByTimeV => (Node::Ask(Rate::ByTimeV, Time::START, V, Y), true),
                Entry::ByTimeY => (Node::Ask(Rate::ByTimeY, Time::START, V, Y), false),
                Entry::SquareV(v, y) => (Node::Ask(Rate::SquareV, Time::START, of(v), of(y)), true),
                Entry::SquareY(v, y) => (Node::Ask(Rate::SquareY, Time::START, of(v), of(y)), false),
                Entry::IfAtMost(all) => (Node::IfAtMost(all.map(of)), made[all[0].index()].1),
                // A step with a mass matrix is one tape (`tapes.rs`), so this is the matrix of units.
                Entry::Mass(a) => {
                    made.push(made[a.index()]);
                    continue;
                }
            };
            let mut push = |node| {
                nodes.push(node);
                nodes.len() - 1
            };
            let numbers = if of_v { shape.v } else { shape.y };
            let at = match node {
                Node::Start(row) => row,
                _ if numbers == 0 => {
                    if of_v {
                        V
                    } else {
                        Y
                    }
                }
                _ => push(node),
            };
            let is_rate = matches!(entry, Entry::Dy(..)) || matches!(entry, Entry::Dv(..)) && !traits.stretched;
            let is_rate = is_rate && numbers > 0;
            let at = if goal == Goal::Attempt && is_rate { push(Node::Stretched(at)) } else { at };
            made.push((at, of_v));
        }
        let results: Vec<usize> = results.iter().map(|block| made[block.index()].0).collect();

        let mut after = vec![0; nodes.len()];
        let mut turn = vec![None; nodes.len()];
        let mut now = 0;
        for (i, node) in nodes.iter().enumerate() {
            after[i] = node.operands().map(|operand| after[operand]).max().unwrap_or(0);
            if matches!(node, Node::Ask(..)) {
                now = now.max(after[i]);
                turn[i] = Some(now);
                after[i] = now + 1;
            }
        }
        let turns = turn.iter().flatten().max().map_or(0, |last| last + 1);
        let mut plan = PassPlan { pass: vec![None; nodes.len()], nodes, results, turn, writes: vec![BTreeSet::new(); turns + 1] };
        for i in 0..plan.nodes.len() {
            if let Some(turn) = plan.turn[i] {
                plan.nodes[i].operands().for_each(|operand| plan.write(operand, turn));
            }
        }
        plan.results.clone().into_iter().for_each(|result| plan.write(result, turns));
        plan
    }

    /// A node is to be in a row after a pass.
    fn write(&mut self, node: usize, pass: usize) {
        if !self.nodes[node].is_given() && self.pass[node].is_none_or(|before| before > pass) {
            if let Some(before) = self.pass[node].replace(pass) {
                self.writes[before].remove(&node);
            }
            self.writes[pass].insert(node);
        }
    }

    /// The nodes that a pass computes, and those that it reads.
    fn work(&self, pass: usize) -> (BTreeSet<usize>, BTreeSet<usize>) {
        let (mut computed, mut read) = (BTreeSet::new(), BTreeSet::new());
        let mut open: Vec<usize> = self.writes[pass].iter().copied().collect();
        while let Some(node) = open.pop() {
            if self.nodes[node].is_given() || self.pass[node].is_some_and(|made| made < pass) {
                read.insert(node);
            } else if computed.insert(node) {
                open.extend(self.nodes[node].operands());
            }
        }
        (computed, read)
    }

    /// How many operations it takes to compute a node in a pass.
    fn cost(&self, node: usize, pass: usize) -> usize {
        if self.nodes[node].is_given() || self.pass[node].is_some_and(|made| made < pass) {
            return 0;
        }
        self.nodes[node].operands().map(|operand| self.cost(operand, pass)).fold(1, usize::saturating_add)
    }

    /// Keeps blocks that more than one pass would compute, if they are expensive.
    fn keep_expensive(&mut self) {
        for pass in 0..self.writes.len() {
            loop {
                let later: BTreeSet<usize> = (pass + 1..self.writes.len()).flat_map(|later| self.work(later).0).collect();
                let (now, _) = self.work(pass);
                let twice = now.into_iter().rev().filter(|node| later.contains(node) && self.pass[*node] != Some(pass));
                let Some(node) = { twice }.find(|node| self.cost(*node, pass) >= MIN_OPERATIONS_PER_ROW) else { break };
                self.write(node, pass);
            }
        }
    }

    /// Gives each block that is kept a row. Time 2k is pass k, 2k + 1 are the rates of turn k.
    fn place(&self, goal: Goal) -> BlockSchedule {
        let (turns, end) = (self.writes.len() - 1, 2 * self.writes.len());
        let works: Vec<_> = (0..=turns).map(|pass| self.work(pass)).collect();
        let mut last = vec![0; self.nodes.len()];
        for (pass, (_, read)) in works.iter().enumerate() {
            read.iter().for_each(|node| last[*node] = 2 * pass);
        }
        for (i, node) in self.nodes.iter().enumerate() {
            if let Some(turn) = self.turn[i] {
                node.operands().for_each(|operand| last[operand] = last[operand].max(2 * turn + 1));
            }
        }
        self.results.iter().for_each(|result| last[*result] = last[*result].max(2 * turns));
        if goal == Goal::Attempt {
            self.results.iter().chain(&[V, Y]).for_each(|node| last[*node] = end);
        }

        let mut rows: Vec<Option<usize>> = vec![None; self.nodes.len()];
        // What stands at the start, and where results stand at the end.
        let homes = if goal == Goal::State { self.results.len() } else { 2 };
        (0..homes).for_each(|row| rows[row] = Some(row));
        let mut busy = last[..homes].to_vec();
        let mut home = vec![goal == Goal::State; homes];
        let mut take = |node: usize, time: usize, rows: &mut Vec<Option<usize>>| {
            // Those that are asked for at one time all read and write: none may take what another reads. A pass goes number by
            // number.
            let is_free = |until: usize| if time.is_multiple_of(2) { until <= time } else { until < time };
            let own = (0..homes).find(|row| home[*row] && self.results[*row] == node && is_free(busy[*row]));
            let row = own.or_else(|| (homes..busy.len()).find(|row| is_free(busy[*row]))).unwrap_or_else(|| {
                busy.push(0);
                busy.len() - 1
            });
            busy[row] = last[node].max(time);
            if own.is_some() {
                (home[row], busy[row]) = (false, end);
            }
            rows[node] = Some(row);
        };
        for time in 0..end {
            match time % 2 {
                0 => self.writes[time / 2].iter().for_each(|node| take(*node, time, &mut rows)),
                _ => {
                    let asked = (0..self.nodes.len()).filter(|node| self.turn[*node] == Some(time / 2));
                    asked.for_each(|node| take(node, time, &mut rows));
                }
            }
        }

        let row = |node: usize| rows[node].unwrap_or(V);
        let count = busy.len();
        let solves = |node: &Node| matches!(node, Node::Ask(Rate::SolutionV | Rate::SolutionY, ..));
        let mut actions = if self.nodes.iter().any(solves) { vec![Action::Derive] } else { Vec::new() };
        for pass in 0..=turns {
            let mut writes: Vec<(usize, usize)> = self.writes[pass].iter().map(|node| (row(*node), *node)).collect();
            if pass == turns && goal == Goal::State {
                // Results in other rows are copied to theirs.
                let away = (0..homes).map(|home| (home, self.results[home]));
                writes.extend(away.filter(|(home, node)| row(*node) != *home));
            }
            if !writes.is_empty() {
                actions.push(Action::Pass(Box::new(self.pass(pass, &writes, count, &row))));
            }
            let mut solved = None;
            for (i, node) in self.nodes.iter().enumerate().filter(|(i, _)| self.turn[*i] == Some(pass)) {
                if let Node::Ask(rate, at, v, y) = *node {
                    let (v, y, out) = (row(v), row(y), row(i));
                    if solves(node) && solved.replace([v, y]) != Some([v, y]) {
                        actions.push(Action::Solve([v, y]));
                    }
                    let ask = match actions.last() {
                        Some(&Action::Ask { rate: Rate::Dv, at: before, v: of_v, y: of_y, out: dv })
                            if rate == Rate::Dy && (before, of_v, of_y) == (at, v, y) =>
                        {
                            actions.pop();
                            Action::Both { at, state: [v, y], out: [dv, out] }
                        }
                        _ => Action::Ask { rate, at, v, y, out },
                    };
                    actions.push(ask);
                }
            }
        }
        let results = match goal {
            Goal::State => (0..homes).collect(),
            Goal::Attempt => self.results.iter().map(|node| row(*node)).collect(),
        };
        BlockSchedule { actions, rows: count, results }
    }

    /// One pass, as a tape whose state is the arena. The step is the step; what an attempt stretches to is the time.
    fn pass(&self, pass: usize, writes: &[(usize, usize)], rows: usize, row: &impl Fn(usize) -> usize) -> Stage {
        let mut tape = Tape::default();
        let mut next: Vec<Id> = (0..rows as u32).map(|row| tape.push(Op::State(row))).collect();
        let mut known: Vec<Option<Id>> = vec![None; self.nodes.len()];
        let (computed, read) = self.work(pass);
        for node in read.into_iter().chain(writes.iter().map(|(_, node)| *node).filter(|node| !computed.contains(node))) {
            known[node] = Some(next[row(node)]);
        }
        for node in computed {
            let of = |operand: usize| known[operand].unwrap_or(0);
            let op = match self.nodes[node] {
                Node::Start(_) | Node::Ask(..) => continue,
                Node::Add(a, b) => Op::Add(of(a), of(b)),
                Node::Sub(a, b) => Op::Sub(of(a), of(b)),
                Node::Scale(c, a) => Op::Mul(tape.constant(c), of(a)),
                Node::IfAtMost([a, b, yes, no]) => Op::Select(tape.push(Op::LessEqual(of(a), of(b))), of(yes), of(no)),
                Node::TimesStep(a) => Op::Mul(tape.push(Op::Step), of(a)),
                Node::PerStep(a) => Op::Div(of(a), tape.push(Op::Step)),
                Node::Stretched(a) => Op::Mul(tape.push(Op::Time), of(a)),
            };
            known[node] = Some(tape.push(op));
        }
        for (row, node) in writes {
            next[*row] = known[*node].unwrap_or(0);
        }
        Stage::new(split(&tape, &next, &|_| true, &|_| true))
    }
}
