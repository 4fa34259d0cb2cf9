//! The springs' forces, laid out for speed, and their energy.
//!
//! Springs are computed side by side in [blocks](super::blocks), the same bytes on every processor.
//!
//! The arguments for the `unsafe` blocks: what needs AVX2 is called only where it was found, and blocks are given lists as long as
//! those that they were made for.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::blocks::{Block, LANES, Padded};
use super::spring::{LIMITED, Law, NO_DIRECTION, Spring, Vectors};

/// Vertices of a chunk: its positions, displacements and forces stay in the nearest caches. Sums run chunk by chunk, so
/// that the number of threads changes no bit.
pub(super) const CHUNK: usize = 2048;
/// Fewer vertices than these are faster on one thread.
const ALONE: usize = 3 * CHUNK;
/// Fewer vectors than these are multiplied faster on one thread.
const ALONE_IN_PRODUCTS: usize = 32 * CHUNK;
/// The springs of a run of vertices: first those with both ends in it, then those that lead out of it, own end first.
#[derive(Debug, Clone, PartialEq)]
struct Chunk {
    own: usize,
    springs: Vec<Spring>,
    blocks: Vec<Block>,
}

/// What is done with the forces on a chunk as soon as they are known.
pub(super) trait After {
    /// Is inlined, so that it becomes as wide as the loops before it.
    fn go_on(self, moved: &Padded, force: &Padded);
}

/// Springs by the vertices that they act on. A spring between two chunks is in both, so that each is summed by itself.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Springs {
    law: Law,
    /// Vertices that they act on.
    vertices: usize,
    /// Those and the ones that hold them: more than any end.
    ends: usize,
    chunks: Vec<Chunk>,
    avx2: bool,
}

impl Springs {
    /// Springs that act on the first `vertices` vertices; those beyond hold them.
    ///
    /// - `rest`: rest positions (mm).
    pub(super) fn new(springs: &[Spring], rest: &Vectors, vertices: usize, law: Law) -> Self {
        let none = Chunk { own: 0, springs: Vec::new(), blocks: Vec::new() };
        let mut chunks = vec![none; vertices.div_ceil(CHUNK)];
        let chunk_of = |v: u32| ((v as usize) < vertices).then_some(v as usize / CHUNK);
        for spring in springs {
            let [a, b] = spring.ends.map(chunk_of);
            if let Some(chunk) = a.filter(|_| a == b) {
                chunks[chunk].springs.push(*spring);
            }
        }
        for chunk in &mut chunks {
            chunk.own = chunk.springs.len();
        }
        for spring in springs {
            let [i, j] = spring.ends;
            let [a, b] = spring.ends.map(chunk_of);
            if a != b {
                for (chunk, ends) in [(a, [i, j]), (b, [j, i])] {
                    if let Some(chunk) = chunk {
                        chunks[chunk].springs.push(Spring { ends, ..*spring });
                    }
                }
            }
        }
        for (number, chunk) in chunks.iter_mut().enumerate() {
            let (own, leading_out) = chunk.springs.split_at_mut(chunk.own);
            apart_in_order(own);
            apart_in_order(leading_out);
            let blocks = own.chunks(LANES).chain(leading_out.chunks(LANES));
            chunk.blocks = blocks.map(|springs| Block::new(springs, rest, number * CHUNK)).collect();
        }
        Self { law, vertices, ends: rest.len(), chunks, avx2: ivd_core::has_avx2() }
    }

    /// What they make of their lengths.
    pub(super) fn law(&self) -> Law {
        self.law
    }

    /// What they make of their lengths from now on.
    pub(super) fn obey(&mut self, law: Law) {
        self.law = law;
    }

    /// Whether the work is worth more than one thread.
    pub(super) fn worth_sharing(&self) -> bool {
        self.vertices >= ALONE
    }

    /// With what not every processor of its kind has, where this one does; or the plain loops.
    pub(super) fn use_simd(&mut self, simd: bool) {
        self.avx2 = simd && ivd_core::has_avx2();
    }

    /// Whether [`Springs::use_simd`] found something to use.
    pub(super) fn is_wide(&self) -> bool {
        self.avx2
    }

    /// Writes the springs' force (µN) on every vertex of a chunk to `force`, its part of the vertices' forces.
    ///
    /// - `moved`: displacements (mm) of all vertices.
    fn on_chunk(&self, chunk: usize, moved: &Vectors, force: &mut Vectors) {
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: AVX2 was found.
            #[allow(unsafe_code, reason = "argued in the module's head")]
            unsafe {
                self.on_chunk_avx2(chunk, moved, force);
            }
            #[cfg(test)]
            crate::mass_spring::planted::spoil(force.as_flattened_mut());
            return;
        }
        self.on_chunk_any(chunk, moved, force);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn on_chunk_avx2(&self, chunk: usize, moved: &Vectors, force: &mut Vectors) {
        self.on_chunk_any(chunk, moved, force);
    }

    /// The same of padded vectors, and then what comes after.
    ///
    /// # Panics
    ///
    /// Where there are fewer displacements than vertices, or other forces than the chunk's.
    pub(super) fn on_padded(&self, chunk: usize, moved: &Padded, force: &mut Padded, after: impl After) {
        assert!(moved.len() >= self.ends && force.len() == CHUNK.min(self.vertices - chunk * CHUNK));
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: AVX2 was found. Ends are less than `ends`; those within the chunk, less its first vertex, than its
            // length: both are as long as was asserted.
            #[allow(unsafe_code, reason = "argued in the module's head")]
            unsafe {
                match (self.law.push, self.law.limit) {
                    (true, None) => self.sum_wide::<true, false>(chunk, moved, force, after),
                    (false, None) => self.sum_wide::<false, false>(chunk, moved, force, after),
                    (true, Some(_)) => self.sum_wide::<true, true>(chunk, moved, force, after),
                    (false, Some(_)) => self.sum_wide::<false, true>(chunk, moved, force, after),
                }
            }
            return;
        }
        self.on_chunk_any(chunk, moved, force);
        after.go_on(moved, force);
    }

    /// # Safety
    ///
    /// That of [`Block::add_wide`], for the chunk's blocks.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    #[allow(unsafe_code, reason = "argued in the module's head")]
    unsafe fn sum_wide<const PUSH: bool, const LIMIT: bool>(
        &self,
        chunk: usize,
        moved: &Padded,
        force: &mut Padded,
        after: impl After,
    ) {
        let limit = self.law.limit.unwrap_or(0.0);
        let Chunk { own, blocks, .. } = &self.chunks[chunk];
        force.fill([0.0; 4]);
        let (own, leading_out) = blocks.split_at(own.div_ceil(LANES));
        // SAFETY: the caller's.
        unsafe {
            Block::add_wide::<PUSH, LIMIT, true>(own, limit, moved, force);
            Block::add_wide::<PUSH, LIMIT, false>(leading_out, limit, moved, force);
        }
        #[cfg(test)]
        crate::mass_spring::planted::spoil(force.as_flattened_mut());
        after.go_on(moved, force);
    }

    #[inline(always)]
    fn on_chunk_any<const W: usize>(&self, chunk: usize, moved: &[[f64; W]], force: &mut [[f64; W]]) {
        match (self.law.push, self.law.limit) {
            (true, None) => self.sum::<true, false, W>(chunk, moved, force),
            (false, None) => self.sum::<false, false, W>(chunk, moved, force),
            (true, Some(_)) => self.sum::<true, true, W>(chunk, moved, force),
            (false, Some(_)) => self.sum::<false, true, W>(chunk, moved, force),
        }
    }

    #[inline(always)]
    fn sum<const PUSH: bool, const LIMIT: bool, const W: usize>(
        &self,
        chunk: usize,
        moved: &[[f64; W]],
        force: &mut [[f64; W]],
    ) {
        let limit = self.law.limit.unwrap_or(0.0);
        let Chunk { own, blocks, .. } = &self.chunks[chunk];
        force.fill([0.0; W]);
        let (own, leading_out) = blocks.split_at(own.div_ceil(LANES));
        for block in own {
            block.add::<PUSH, LIMIT, true, W>(limit, moved, force);
        }
        for block in leading_out {
            block.add::<PUSH, LIMIT, false, W>(limit, moved, force);
        }
    }

    /// Writes the springs' force (µN) on every vertex.
    pub(super) fn forces(&self, moved: &Vectors, force: &mut Vectors) {
        let of = |(chunk, force): (usize, &mut Vectors)| self.on_chunk(chunk, moved, force);
        if self.worth_sharing() {
            force.par_chunks_mut(CHUNK).enumerate().for_each(of);
        } else {
            force.chunks_mut(CHUNK).enumerate().for_each(of);
        }
    }

    /// Energy of the springs (nJ), each once.
    pub(super) fn energy(&self, rest: &Vectors, moved: &Vectors) -> f64 {
        self.total(|spring| {
            let (at, by) = apart(spring, rest, moved);
            let stretch = stretch(spring, at, by);
            let [below, beyond] = self.stretches(stretch, spring.length);
            0.5 * spring.stiffness * (below * below + LIMITED * beyond * beyond)
        })
    }

    /// How much the springs' energy (nJ) grows where the vertices go on by `way` (mm) from `moved`. It is a sum of each
    /// spring's own growth, exact where the energies themselves differ by less than their rounding.
    pub(super) fn energy_growth(&self, moved: &Vectors, way: &Vectors) -> f64 {
        let of = |chunk: &Chunk| self.growth_of_chunk(chunk, moved, way);
        let sums: Vec<f64> = if self.worth_sharing() {
            self.chunks.par_iter().map(of).collect()
        } else {
            self.chunks.iter().map(of).collect()
        };
        sums.iter().sum()
    }

    fn growth_of_chunk(&self, chunk: &Chunk, moved: &Vectors, way: &Vectors) -> f64 {
        #[cfg(target_arch = "x86_64")]
        if self.avx2 {
            // SAFETY: AVX2 was found.
            #[allow(unsafe_code, reason = "argued in the module's head")]
            return unsafe { self.growth_avx2(chunk, moved, way) };
        }
        self.growth_any(chunk, moved, way)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn growth_avx2(&self, chunk: &Chunk, moved: &Vectors, way: &Vectors) -> f64 {
        self.growth_any(chunk, moved, way)
    }

    #[inline(always)]
    fn growth_any(&self, chunk: &Chunk, moved: &Vectors, way: &Vectors) -> f64 {
        match (self.law.push, self.law.limit) {
            (true, None) => self.growth::<true, false>(chunk, moved, way),
            (false, None) => self.growth::<false, false>(chunk, moved, way),
            (true, Some(_)) => self.growth::<true, true>(chunk, moved, way),
            (false, Some(_)) => self.growth::<false, true>(chunk, moved, way),
        }
    }

    #[inline(always)]
    fn growth<const PUSH: bool, const LIMIT: bool>(
        &self,
        chunk: &Chunk,
        moved: &Vectors,
        way: &Vectors,
    ) -> f64 {
        let limit = self.law.limit.unwrap_or(0.0);
        let mut sums = [0.0; LANES];
        let (own, leading_out) = chunk.blocks.split_at(chunk.own.div_ceil(LANES));
        for block in own {
            block.add_growth::<PUSH, LIMIT, true>(limit, moved, way, &mut sums);
        }
        for block in leading_out {
            block.add_growth::<PUSH, LIMIT, false>(limit, moved, way, &mut sums);
        }
        sums.iter().sum()
    }

    /// The part of a stretch (mm) that counts, and the part that counts a hundredfold.
    fn stretches(&self, stretch: f64, length: f64) -> [f64; 2] {
        let below = if self.law.push { stretch } else { stretch.max(0.0) };
        [below, self.law.limit.map_or(0.0, |limit| (stretch - limit * length).max(0.0))]
    }

    /// Sum over all springs, each once, in an order that only the springs determine.
    fn total(&self, of: impl Fn(&Spring) -> f64 + Sync) -> f64 {
        let sum = |chunk: &Chunk| -> f64 {
            let (own, leading_out) = chunk.springs.split_at(chunk.own);
            own.iter().map(&of).sum::<f64>()
                + leading_out.iter().filter(|s| s.ends[0] < s.ends[1]).map(&of).sum::<f64>()
        };
        let sums: Vec<f64> = self.chunks.par_iter().map(sum).collect();
        sums.iter().sum()
    }
}

/// Puts springs of one end, which lie together, in turn with those of its neighbours: a sum need not wait for the one before.
fn apart_in_order(springs: &mut [Spring]) {
    const WINDOW: u32 = 64;
    let mut ranks = Vec::with_capacity(springs.len());
    for (s, spring) in springs.iter().enumerate() {
        let follows = s > 0 && springs[s - 1].ends[0] == spring.ends[0];
        ranks.push(if follows { ranks[s - 1] + 1 } else { 0_u32 });
    }
    let mut keyed: Vec<((u32, u32), Spring)> =
        springs.iter().zip(&ranks).map(|(s, rank)| ((s.ends[0] / WINDOW, *rank), *s)).collect();
    keyed.sort_by_key(|(key, _)| *key);
    for (to, (_, from)) in springs.iter_mut().zip(keyed) {
        *to = from;
    }
}

/// The way from a spring's first end to the other at rest, and what their motion adds to it (mm).
fn apart(spring: &Spring, rest: &Vectors, moved: &Vectors) -> (Vector3<f64>, Vector3<f64>) {
    let [i, j] = spring.ends.map(|v| v as usize);
    let between = |of: &Vectors| Vector3::from(of[j]) - Vector3::from(of[i]);
    (between(rest), between(moved))
}

/// How much longer a spring is than at rest (mm), without the cancellation of a difference.
fn stretch(spring: &Spring, at: Vector3<f64>, by: Vector3<f64>) -> f64 {
    let lengths = (at + by).norm() + spring.length;
    if lengths > 0.0 { (2.0 * at + by).dot(&by) / lengths } else { 0.0 }
}

/// Force of a spring on its first end (µN); the other gets the negative. What [`Springs`] sums, one spring at a time.
pub(super) fn pull(spring: &Spring, law: Law, rest: &Vectors, moved: &Vectors) -> Vector3<f64> {
    let (at, by) = apart(spring, rest, moved);
    let now = (at + by).norm();
    if now <= NO_DIRECTION * spring.length {
        return Vector3::zeros();
    }
    let stretch = stretch(spring, at, by);
    let beyond = law.limit.map_or(0.0, |limit| (stretch - limit * spring.length).max(0.0));
    let counts = if law.push { stretch } else { stretch.max(0.0) };
    (at + by) * (spring.stiffness * (counts + LIMITED * beyond) / now)
}

/// Scalar product of two lists of vectors, summed chunk by chunk, and in a chunk lane by lane.
pub(super) fn dot(a: &Vectors, b: &Vectors) -> f64 {
    let of = |(a, b): (&Vectors, &Vectors)| -> f64 {
        let (a, b) = (a.as_flattened().chunks_exact(LANES), b.as_flattened().chunks_exact(LANES));
        let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
        let mut sums = [0.0; LANES];
        for (a, b) in a.zip(b) {
            for lane in 0..LANES {
                sums[lane] += a[lane] * b[lane];
            }
        }
        sums.iter().sum::<f64>() + rest
    };
    let sums: Vec<f64> = if a.len() >= ALONE_IN_PRODUCTS {
        a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(of).collect()
    } else {
        a.chunks(CHUNK).zip(b.chunks(CHUNK)).map(of).collect()
    };
    sums.iter().sum()
}

/// Length of a list of vectors; infinite where a component isn't finite.
pub(super) fn norm(a: &Vectors) -> f64 {
    // Neither lost nor beyond all bounds, so every component is finite.
    let squared = dot(a, a);
    if (1e-150..1e150).contains(&squared) {
        return squared.sqrt();
    }
    if !a.iter().flatten().all(|c| c.is_finite()) {
        return f64::INFINITY;
    }
    // Largest first, so that neither 1e200 nor 1e-200 is lost in its square.
    let most = a.iter().flatten().fold(0.0_f64, |most, c| most.max(c.abs()));
    if most == 0.0 {
        return 0.0;
    }
    let scaled: Vec<[f64; 3]> = a.iter().map(|v| v.map(|c| c / most)).collect();
    dot(&scaled, &scaled).sqrt() * most
}
