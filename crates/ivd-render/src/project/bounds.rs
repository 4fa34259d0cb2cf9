/// Bricks along a block's edge.
pub(crate) const BLOCK_BRICKS: usize = 4;

/// Values that no sample exceeds: of every brick, and of blocks of [`BLOCK_BRICKS`]³ of them.
#[derive(Default)]
pub(crate) struct Bounds {
    pub(crate) of_bricks: Vec<f32>,
    pub(crate) of_blocks: Vec<f32>,
    /// Blocks along each axis.
    pub(crate) blocks: [usize; 3],
}

impl Bounds {
    /// - `of_bricks`: a value for each of so many bricks.
    pub(crate) fn new(bricks: [usize; 3], of_bricks: Vec<f32>) -> Self {
        let blocks = bricks.map(|n| n.div_ceil(BLOCK_BRICKS));
        let mut of_blocks = vec![f32::NEG_INFINITY; blocks.iter().product()];
        for (i, &bound) in of_bricks.iter().enumerate() {
            let at = [i % bricks[0], i / bricks[0] % bricks[1], i / (bricks[0] * bricks[1])];
            let [x, y, z] = at.map(|b| b / BLOCK_BRICKS);
            let of_block = &mut of_blocks[x + blocks[0] * (y + blocks[1] * z)];
            *of_block = of_block.max(bound);
        }
        let bounds = Self { of_bricks, of_blocks, blocks };
        bounds.check(bricks);
        bounds
    }

    /// There is a bound for each of so many bricks, and for each of their blocks.
    pub(crate) fn check(&self, bricks: [usize; 3]) {
        assert_eq!(self.of_bricks.len(), bricks.iter().product::<usize>(), "a bound for every brick");
        assert_eq!(self.blocks, bricks.map(|n| n.div_ceil(BLOCK_BRICKS)), "blocks of these bricks");
        assert_eq!(self.of_blocks.len(), self.blocks.iter().product::<usize>(), "a bound for every block");
    }
}
