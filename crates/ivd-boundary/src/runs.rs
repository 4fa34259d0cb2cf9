//! Connected components by runs: a row of voxels is a few intervals, and only intervals are joined.

use std::ops::Range;

use ivd_core::{Error, parallel, sets};

/// Runs (start, and one past the end) of chosen voxels along x in every row of a box, rows by y, then z.
pub(crate) struct Runs {
    size: [usize; 3],
    spans: Vec<[u32; 2]>,
    /// First run of each row, and the number of runs.
    rows: Vec<usize>,
}

/// Number of components, of which each is named by its first run.
pub(crate) fn piece_count(components: &[u32]) -> usize {
    components.iter().enumerate().filter(|(run, first)| *run == **first as usize).count()
}

impl Runs {
    /// Finds the runs in a box of `size` voxels; `row(y, z, found)` appends the ascending runs of one row.
    pub(crate) fn find(size: [usize; 3], row: impl Fn(usize, usize, &mut Vec<[u32; 2]>) + Sync) -> Self {
        let slices: Vec<(Vec<[u32; 2]>, Vec<usize>)> = parallel::map(size[2], &|z| {
            let mut runs = Vec::new();
            let ends = (0..size[1])
                .map(|y| {
                    row(y, z, &mut runs);
                    runs.len()
                })
                .collect();
            (runs, ends)
        });
        let mut all = Self {
            size,
            spans: Vec::with_capacity(slices.iter().map(|s| s.0.len()).sum()),
            rows: Vec::with_capacity(size[1] * size[2] + 1),
        };
        all.rows.push(0);
        for (runs, ends) in &slices {
            let before = all.spans.len();
            all.rows.extend(ends.iter().map(|end| before + end));
            all.spans.extend_from_slice(runs);
        }
        all
    }

    /// Number of runs.
    pub(crate) fn len(&self) -> usize {
        self.spans.len()
    }

    /// Voxels of a run along x.
    pub(crate) fn span(&self, run: usize) -> Range<usize> {
        self.spans[run][0] as usize..self.spans[run][1] as usize
    }

    /// Linear index, in a volume of the box's size, of the first voxel.
    pub(crate) fn first_voxel(&self) -> Option<usize> {
        (self.len() > 0).then(|| self.linear(self.first(0)))
    }

    /// Linear index of a voxel in a volume of the box's size.
    pub(crate) fn linear(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }

    /// The first voxel of a run.
    pub(crate) fn first(&self, run: usize) -> [usize; 3] {
        let row = self.rows.partition_point(|before| *before <= run) - 1;
        [self.span(run).start, row % self.size[1], row / self.size[1]]
    }

    /// Indices of the runs of a row.
    pub(crate) fn row(&self, y: usize, z: usize) -> Range<usize> {
        let row = y + self.size[1] * z;
        self.rows[row]..self.rows[row + 1]
    }

    /// The component of every run, named by its first run: runs that touch through faces are joined.
    ///
    /// # Errors
    /// [`Error::Inconsistent`]: more runs than have a number.
    pub(crate) fn components(&self) -> Result<Vec<u32>, Error> {
        if self.len() > u32::MAX as usize {
            let problem =
                format!("{} runs of voxels along x, at most {} are joined; crop it", self.len(), u32::MAX);
            return Err(Error::Inconsistent { what: "volume", problem });
        }
        let mut parts = sets::singles(self.len());
        for z in 0..self.size[2] {
            for y in 0..self.size[1] {
                let row = self.row(y, z);
                if row.is_empty() {
                    continue;
                }
                if y > 0 {
                    self.join(&row, &self.row(y - 1, z), &mut parts);
                }
                if z > 0 {
                    self.join(&row, &self.row(y, z - 1), &mut parts);
                }
            }
        }
        sets::flatten(&mut parts);
        Ok(parts)
    }

    /// Joins the touching runs of two neighbouring rows.
    fn join(&self, a: &Range<usize>, b: &Range<usize>, parts: &mut [u32]) {
        let (mut i, mut j) = (a.start, b.start);
        while i < a.end && j < b.end {
            let ([start, end], [other_start, other_end]) = (self.spans[i], self.spans[j]);
            if start < other_end && other_start < end {
                sets::join(parts, i as u32, j as u32);
            }
            if end < other_end {
                i += 1;
            } else {
                j += 1;
            }
        }
    }
}
