//! The kernel `lattice/cut`: signs, counts, sums, vertices and triangles, in the order of words of 32 cells.
//!
//! What the signs leave open is decided by the processor between two submissions, and so are the places of vertices after the last one: both are the field's own
//! arithmetic, which stands once.

use ivd_core::{Answer, DeviceForm, Exec, Kernel as _};
use ivd_lattice::extract::plan::{Cut, Cutting, Decided, OpenCell, Signs, Surface};

use crate::buffers::Room;
use crate::pass::{Part, Pass};
use crate::shared::{Opened, RESULT, answer};
use crate::stored::rank;
use crate::{Error, Gpu, SharedGpu};

/// Lanes of a workgroup, each of a word.
const LANES: usize = 256;
/// Numbers that a workgroup sums.
const CHUNK: usize = 2048;
/// Room for crossings in the shaders' table.
const CROSSINGS: usize = 1024;
/// Cells that are decided before it is asked whether to go on.
const DECIDED: usize = 1 << 14;
/// Bytes that are read at once, at most.
const READ: u64 = 64 << 20;

/// What the device makes of a cut.
struct Linked {
    keys: Vec<u64>,
    triangles: Vec<[u32; 3]>,
    cells: Vec<(OpenCell, Decided)>,
}

impl DeviceForm<Cutting> for SharedGpu {
    fn run(&self, cut: &Cut<'_>, exec: &Exec) -> Result<Answer<Surface>, ivd_core::Error> {
        if let Signs::Stored { volume, .. } = cut.signs {
            // What is mapped is looked at by all threads, which nobody may wait for who has the device.
            volume.voxels();
        }
        let linked = self.attempt(|opened| opened.link(cut, exec));
        // The processor's share, once the device is free.
        let finish = |Linked { keys, triangles, cells }| Ok(cut.finish(keys, triangles, &cells, exec)?);
        answer(Cutting::NAME, linked.and_then(finish))
    }
}

/// What shaders know of cells, as tables.wgsl has it.
fn tables(cut: &Cut<'_>) -> Vec<u32> {
    let [spans, corners] = cut.crossings();
    let mut tables = cut.cases();
    let crossings_at = tables.len();
    tables.extend(spans);
    tables.resize(crossings_at + CROSSINGS, 0);
    tables.extend(corners);
    tables
}

/// The words of a cut's cells.
#[derive(Clone, Copy)]
struct Words {
    /// Words a row, rows a layer, layers.
    size: [usize; 3],
    /// Padded voxels along x.
    width: usize,
}

impl Words {
    fn of([nx, ny, nz]: [usize; 3]) -> Self {
        Self { size: [(nx + 2).div_ceil(32) + 1, ny + 2, nz + 2], width: nx + 2 }
    }

    fn all(self) -> usize {
        self.size.iter().product()
    }

    /// The shaders' parameters, with two ranks or nothing, and a count.
    fn numbers(self, ranks: [u32; 2], count: usize) -> Vec<u32> {
        let [words, rows, layers] = self.size.map(|n| n as u32);
        vec![words, rows, layers, self.width as u32, ranks[0], ranks[1], count as u32]
    }

    /// A pass over all words, and so many more.
    fn pass<'a>(self, pipeline: &'a wgpu::ComputePipeline, rooms: &[&'a Room], more: usize) -> Pass<'a> {
        let groups = (self.all() + more).div_ceil(LANES);
        Pass { pipeline, numbers: self.numbers([0; 2], 0), rooms: rooms.to_vec(), groups }
    }

    /// What a word and the bit and case beside it stand for.
    fn cell(self, [word, of]: [u32; 2]) -> OpenCell {
        let [words, rows, _] = self.size;
        let (row, of_row) = (word as usize / words, word as usize % words);
        let padded = [32 * of_row + (of & 31) as usize, row % rows, row / rows];
        OpenCell { padded, case: (of >> 8) as u8 }
    }
}

/// The pipelines of running sums.
struct Scans {
    within: wgpu::ComputePipeline,
    add: wgpu::ComputePipeline,
}

impl Scans {
    /// Room for the sums of chunks, of the chunks' chunks, and so on to one.
    fn rooms(gpu: &Gpu, mut len: usize) -> Result<Vec<(Room, usize)>, Error> {
        let mut rooms = Vec::new();
        while rooms.is_empty() || len > 1 {
            len = len.div_ceil(CHUNK);
            rooms.push((gpu.room("sums", 4 * len as u64, RESULT)?, len));
        }
        Ok(rooms)
    }

    /// The passes that put in the place of each number of `values` the sum of those before it.
    fn passes<'a>(&'a self, values: &'a Room, len: usize, sums: &'a [(Room, usize)]) -> Vec<Pass<'a>> {
        let lower = std::iter::once((values, len)).chain(sums.iter().map(|(room, len)| (room, *len)));
        let levels: Vec<_> = lower.zip(sums).collect();
        let pass = |pipeline: &'a wgpu::ComputePipeline, of: &((&'a Room, usize), &'a (Room, usize))| {
            let ((values, len), (sums, chunks)) = of;
            Pass { pipeline, numbers: vec![*len as u32], rooms: vec![values, sums], groups: *chunks }
        };
        let up = levels.iter().map(|level| pass(&self.within, level));
        // The sum of the last level's one chunk is added to nothing.
        let down = levels.iter().rev().skip(1).map(|level| pass(&self.add, level));
        up.chain(down).collect()
    }
}

impl Opened {
    fn link(&mut self, cut: &Cut<'_>, exec: &Exec) -> Result<Linked, Error> {
        let words = Words::of(cut.dims);
        let all = words.all();
        let padded = words.width * words.size[1] * words.size[2];
        // Vertices and triangles are counted together in 32 bits; a cell has five of those and twelve of these at most.
        if padded as u64 * 17 > u64::from(u32::MAX) {
            return Err(Error::TooLarge { what: "the lattice", bytes: 4 * 17 * padded as u64 });
        }
        let signs = self.signs(cut, words, exec)?;
        let tables = self.gpu.upload("the tables of cells", bytemuck::cast_slice(&tables(cut)))?;
        let counts = self.gpu.room("the counts", 8 * (all as u64 + 1), RESULT)?;
        let opens = self.gpu.room("the open cells of words", 4 * (all as u64 + 1), RESULT)?;
        let scans = Scans {
            within: self.pipeline("shared/scan.wgsl", &[])?,
            add: self.pipeline("shared/scan.wgsl", &["ADD"])?,
        };

        let count = self.pipeline("lattice/count.wgsl", &[])?;
        let sums = Scans::rooms(&self.gpu, all + 1)?;
        let counting = words.pass(&count, &[&signs, &tables, &counts, &opens], 1);
        self.desk.make(&self.gpu, "counts of cells", &[counting], &[], exec, |_| {})?;
        let passes = scans.passes(&opens, all + 1, &sums);
        let [open] = self.totals(&passes, [(&opens, all)], exec)?;

        let (list, cells) = self.open_cells(words, [&signs, &tables, &opens], open as usize, exec)?;
        let mut decided = Vec::with_capacity(cells.len());
        for some in cells.chunks(DECIDED) {
            exec.check_cancelled()?;
            decided.extend(cut.decide(some));
        }
        let packed = cells.iter().zip(&decided).map(|(cell, decided)| {
            (cell.padded[0] % 32) as u32 | decided.own << 5 | u32::from(decided.crossing) << 8
        });
        let packed: Vec<u32> = packed.collect();
        let at_cells = self.gpu.upload("what was decided", bytemuck::cast_slice(&packed))?;

        let add = self.pipeline("lattice/add.wgsl", &[])?;
        let sums = Scans::rooms(&self.gpu, 2 * (all + 1))?;
        let mut passes = Vec::new();
        if !cells.is_empty() {
            passes.push(Pass {
                pipeline: &add,
                numbers: words.numbers([0; 2], cells.len()),
                rooms: vec![&list, &at_cells, &tables, &counts],
                groups: cells.len().div_ceil(LANES),
            });
        }
        passes.extend(scans.passes(&counts, 2 * (all + 1), &sums));
        let [vertices, both] = self.totals(&passes, [(&counts, all), (&counts, 2 * all + 1)], exec)?;
        let triangles = both - vertices;

        let held = 8 * u64::from(vertices) + 12 * u64::from(triangles) + 48 * cells.len() as u64;
        exec.check_memory("the lattice", held)?;
        let keys = self.gpu.room("the vertices", 8 * u64::from(vertices), RESULT)?;
        let corners = self.gpu.room("the triangles", 12 * u64::from(triangles), RESULT)?;
        let (place, link) =
            (self.pipeline("lattice/vertices.wgsl", &[])?, self.pipeline("lattice/triangles.wgsl", &[])?);
        let passes = [
            words.pass(&place, &[&signs, &counts, &opens, &at_cells, &keys], 0),
            words.pass(&link, &[&signs, &tables, &counts, &opens, &at_cells, &corners], 0),
        ];
        self.desk.make(&self.gpu, "the lattice", &passes, &[], exec, |_| {})?;
        let keys = self.read(&keys, vertices as usize, exec)?;
        let triangles = self.read(&corners, triangles as usize, exec)?;
        Ok(Linked { keys, triangles, cells: cells.into_iter().zip(decided).collect() })
    }

    /// The signs of all voxels.
    fn signs(&mut self, cut: &Cut<'_>, words: Words, exec: &Exec) -> Result<Room, Error> {
        let (volume, first, last) = match cut.signs {
            Signs::Read { rows, .. } => return self.gpu.upload("the signs", bytemuck::cast_slice(rows)),
            Signs::Stored { volume, first, last } => (volume, first, last),
        };
        let names = self.bring_stored(volume.voxels())?;
        let pipeline = self.pipeline("lattice/signs.wgsl", &names)?;
        let signs = self.gpu.room("the signs", 4 * words.all() as u64, RESULT)?;
        let ranks = if first <= last { [first, last].map(|v| rank(volume.voxel_type(), v)) } else { [1, 0] };
        let pass = Pass {
            pipeline: &pipeline,
            numbers: words.numbers(ranks, 0),
            rooms: self.volume.iter().map(|kept| &kept.room).chain([&signs]).collect(),
            groups: words.all().div_ceil(LANES),
        };
        self.desk.make(&self.gpu, "signs", &[pass], &[], exec, |_| {})?;
        Ok(signs)
    }

    /// The cells that the signs leave open, on the device and here.
    fn open_cells(
        &mut self,
        words: Words,
        [signs, tables, opens]: [&Room; 3],
        count: usize,
        exec: &Exec,
    ) -> Result<(Room, Vec<OpenCell>), Error> {
        let list = self.gpu.room("the open cells", 8 * count as u64, RESULT)?;
        if count == 0 {
            return Ok((list, Vec::new()));
        }
        let pipeline = self.pipeline("lattice/open.wgsl", &[])?;
        let pass = words.pass(&pipeline, &[signs, tables, opens, &list], 0);
        self.desk.make(&self.gpu, "open cells", &[pass], &[], exec, |_| {})?;
        let read: Vec<[u32; 2]> = self.read(&list, count, exec)?;
        Ok((list, read.into_iter().map(|cell| words.cell(cell)).collect()))
    }

    /// Makes passes, and reads single words.
    fn totals<const N: usize>(
        &mut self,
        passes: &[Pass<'_>],
        at: [(&Room, usize); N],
        exec: &Exec,
    ) -> Result<[u32; N], Error> {
        let parts = at.map(|(room, word)| Part { room, from: 4 * word as u64, bytes: 4 });
        let mut totals = [0; N];
        self.desk.make(&self.gpu, "sums", passes, &parts, exec, |read| {
            bytemuck::cast_slice_mut(&mut totals).copy_from_slice(read);
        })?;
        Ok(totals)
    }

    /// Reads so many values, in parts.
    fn read<T: bytemuck::Pod>(&mut self, room: &Room, count: usize, exec: &Exec) -> Result<Vec<T>, Error> {
        let mut values = vec![T::zeroed(); count];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        for (i, to) in bytes.chunks_mut(READ as usize).enumerate() {
            let part = Part { room, from: i as u64 * READ, bytes: to.len() as u64 };
            self.desk.make(&self.gpu, "a result", &[], &[part], exec, |read| to.copy_from_slice(read))?;
        }
        Ok(values)
    }
}
