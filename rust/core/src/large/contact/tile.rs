//! Contact of many points side by side: a tape of one point, whose lanes are the points that may have met a surface.

use std::sync::{Arc, LazyLock};

use crate::{
    aligned::Aligned,
    error::Error,
    isa::Level,
    model::{
        around::contact::{Contacts, dimensions},
        spec::{Row, Signature, Spec},
    },
    stage::{Clock, PreparedStage, Stage},
    step::{cache::Cache, parameters},
    tape::{
        Op, Tape,
        number::{Number, Symbol, record},
    },
};

/// How many points of one member go side by side: enough vectors that their roots and quotients overlap.
const POINTS: usize = 32;

/// Stages by the surfaces alone: systems that meet the same ones share the tape.
static CACHE: LazyLock<Cache<Arc<Signature>, Stage>> = LazyLock::new(Cache::default);

/// The tape of a point. Its state is v and y before the step, v and y after it, and whether the point met a surface.
fn stage(signature: &Arc<Signature>) -> Option<Arc<Stage>> {
    let dim = dimensions(signature);
    let traced = CACHE.find(signature, || {
        let traced = record(Tape::default(), || {
            let state: Vec<Symbol> = (0..4 * dim).map(|i| Symbol::new(Op::State(i as u32))).collect();
            let (before, after) = state.split_at(2 * dim);
            let (mut after, touched) = (after.to_vec(), Symbol::new(Op::State(4 * dim as u32)));
            let (v, y) = after.split_at_mut(dim);
            let contacts = Contacts::new(&parameters(signature, Symbol::new(Op::Step)));
            let met = contacts.and_then(|contacts| contacts.resolve_point([&before[..dim], &before[dim..]], [v, y]));
            let touched = met.map_or(touched, |met| Symbol::choose(met, Symbol::of(1.0), Symbol::of(0.0)));
            before.iter().chain(&after).chain([&touched]).map(|number| number.0).collect()
        });
        let stage = Stage::cut(signature, &traced);
        let size = stage.size();
        Ok::<_, Error>((stage, size))
    });
    traced.ok()
}

/// The part of a description that is about surfaces.
fn of_surfaces<'a>(spec: &Spec<'a>) -> Spec<'a> {
    let whole = &spec.signature;
    let is_of_surface = |name: &str| name.starts_with("contact");
    let (mut signature, mut rows, mut first) =
        (Signature { system: whole.system.clone(), ..Signature::default() }, Vec::new(), 0);
    signature.words = whole.words.iter().filter(|(name, _)| is_of_surface(name)).cloned().collect();
    signature.wholes = whole.wholes.iter().filter(|(name, _)| is_of_surface(name)).cloned().collect();
    for (name, common) in &whole.rows {
        if is_of_surface(name) {
            rows.extend(spec.rows[first..first + common.len()].iter().map(|Row(numbers)| Row(numbers)));
            signature.rows.push((name.clone(), common.clone()));
        }
        first += common.len();
    }
    Spec { signature: Arc::new(signature), rows, tables: Vec::new() }
}

/// A kernel for as many points as it has places.
pub(super) struct Tile {
    stage: Arc<Stage>,
    prepared: PreparedStage,
    state: Aligned,
    dim: usize,
    lanes: usize,
}

/// The blocks of a group: v and y before the step, and v and y after it, which are changed.
pub(super) struct Ends<'a> {
    pub before: [&'a [f64]; 2],
    pub after: [&'a mut [f64]; 2],
}

impl Tile {
    /// For the members from `first`, `lanes` of them side by side; lanes past the `count`-th repeat the last one.
    pub(super) fn new(spec: &Spec, level: Level, h: f64, [lanes, first, count]: [usize; 3]) -> Option<Tile> {
        let spec = of_surfaces(spec);
        let (stage, dim) = (stage(&spec.signature)?, dimensions(&spec.signature));
        let places = if lanes == 1 { POINTS } else { lanes };
        let compiled = stage.compiled_for_lanes(level, places);
        let mut prepared = PreparedStage::with(&stage, compiled, &spec, &Clock { t0: 0.0, h }, f64::INFINITY);
        prepared.prepare(&stage, &spec, first, count);
        Some(Tile { state: Aligned::new((4 * dim + 1) * places), stage, prepared, dim, lanes })
    }

    /// Changes these points of all members, and says of each number whether it belongs to a point that met a surface.
    pub(super) fn resolve(&mut self, points: &[u32], ends: Ends, touched: &mut [bool]) {
        match (self.lanes, self.dim) {
            (1, 1) => self.resolve_one::<1>(points, ends, touched),
            (1, 2) => self.resolve_one::<2>(points, ends, touched),
            (1, _) => self.resolve_one::<3>(points, ends, touched),
            _ => self.resolve_several(points, ends, touched),
        }
    }

    /// The points of one member, as many as there are places.
    fn resolve_one<const D: usize>(&mut self, points: &[u32], Ends { before, after: [v, y] }: Ends, touched: &mut [bool]) {
        let before = before.map(|block| block.as_chunks::<D>().0);
        let ([v, y], touched) = ([v, y].map(|block| block.as_chunks_mut::<D>().0), touched.as_chunks_mut::<D>().0);
        for points in points.chunks(POINTS) {
            let blocks = self.state.as_chunks_mut::<POINTS>().0.as_chunks_mut::<D>().0;
            for (rows, block) in blocks.iter_mut().zip([before[0], before[1], v, y]) {
                for (k, point) in points.iter().enumerate().take(POINTS) {
                    let numbers = &block[*point as usize];
                    (0..D).for_each(|c| rows[c][k] = numbers[c]);
                }
            }
            self.prepared.advance_at(&self.stage, 0.0, &mut self.state);
            let (rows, _) = self.state.as_chunks::<POINTS>();
            let (blocks, _) = rows.as_chunks::<D>();
            for (rows, block) in blocks[2..].iter().zip([&mut *v, &mut *y]) {
                for (k, point) in points.iter().enumerate().take(POINTS) {
                    let numbers = &mut block[*point as usize];
                    (0..D).for_each(|c| numbers[c] = rows[c][k]);
                }
            }
            let met = &rows[4 * D];
            points.iter().zip(met).for_each(|(point, met)| touched[*point as usize] = [*met != 0.0; D]);
        }
    }

    /// A point of all members at a time.
    fn resolve_several(&mut self, points: &[u32], Ends { before: [v0, y0], after: [v, y] }: Ends, touched: &mut [bool]) {
        let (dim, lanes) = (self.dim, self.lanes);
        for point in points {
            let numbers = *point as usize * dim * lanes..(*point as usize + 1) * dim * lanes;
            let blocks = self.state.chunks_exact_mut(dim * lanes).zip([v0, y0, &*v, &*y]);
            blocks.for_each(|(rows, block)| rows.copy_from_slice(&block[numbers.clone()]));
            self.prepared.advance_at(&self.stage, 0.0, &mut self.state);
            let mut blocks = self.state.chunks_exact(dim * lanes).skip(2);
            for (block, rows) in [&mut *v, &mut *y].into_iter().zip(&mut blocks) {
                block[numbers.clone()].copy_from_slice(rows);
            }
            let met = self.state[4 * dim * lanes..].iter().map(|met| *met != 0.0).cycle();
            touched[numbers].iter_mut().zip(met).for_each(|(to, met)| *to = met);
        }
    }
}
