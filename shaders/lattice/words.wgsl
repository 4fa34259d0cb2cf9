// Signs of the voxels, a bit each, in rows of words as ivd-lattice's signs.rs has them: bit p of a row is the padded voxel p, the last word of a row is 0, and so are the rows of
// the border layer.

struct Params {
    number: u32,
    words: u32, // a row
    rows: u32,  // a layer
    layers: u32,
    width: u32, // padded voxels along x
    first: u32, // of the values: ranks of the first and the last one inside
    last: u32,
    count: u32, // open cells
}

@group(0) @binding(0) var<storage, read> params: Params;

//#include shared/lanes.wgsl

fn all_words() -> u32 {
    return params.words * params.rows * params.layers;
}
