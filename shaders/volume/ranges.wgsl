// The least and the greatest stored value of each brick, as ranks, and whether data is missing in it: BrickIndex::build. 32 lanes a brick of 9³ voxels.

struct Params {
    number: u32,
    nx: u32,
    ny: u32,
    nz: u32,
    across: u32, // bricks along x and y, and all
    down: u32,
    bricks: u32,
}

@group(0) @binding(0) var<storage, read> params: Params;
@group(0) @binding(2) var<storage, read> volume: array<u32>;
@group(0) @binding(3) var<storage, read_write> ranges: array<u32>;

//#include shared/pass.wgsl
//#include shared/stored.wgsl

const BRICKS = 8u;

var<workgroup> least: array<atomic<u32>, BRICKS>;
var<workgroup> most: array<atomic<u32>, BRICKS>;
var<workgroup> missing: array<atomic<u32>, BRICKS>;

@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if (lane < BRICKS) {
        atomicStore(&least[lane], 0xffffffffu);
        atomicStore(&most[lane], 0u);
        atomicStore(&missing[lane], 0u);
    }
    workgroupBarrier();
    let first = BRICKS * place_in(group, groups);
    // Lanes beside each other read what lies beside each other: the same row of eight bricks.
    let mine = lane & (BRICKS - 1u);
    let brick = first + mine;
    if (brick < params.bricks) {
        let at = 8u * vec3<u32>(brick % params.across, brick / params.across % params.down, brick / (params.across * params.down));
        let size = min(vec3<u32>(9u), vec3<u32>(params.nx, params.ny, params.nz) - at);
        var low = 0xffffffffu;
        var high = 0u;
        var gap = 0u;
        for (var row = lane / BRICKS; row < size.y * size.z; row += 256u / BRICKS) {
            let start = at.x + params.nx * (at.y + row % size.y + params.ny * (at.z + row / size.y));
            let words = words_from(start);
            for (var x = 0u; x < size.x; x += IN_A_WORD) {
                let word = word_of(words, x / IN_A_WORD);
                for (var i = 0u; i < IN_A_WORD; i++) {
                    if (x + i < size.x) {
                        let r = rank_in(word, i);
                        if (is_number(r)) {
                            low = min(low, r);
                            high = max(high, r);
                        } else {
                            gap = 1u;
                        }
                    }
                }
            }
        }
        atomicMin(&least[mine], low);
        atomicMax(&most[mine], high);
        atomicMax(&missing[mine], gap);
    }
    workgroupBarrier();
    if (lane < BRICKS && first + lane < params.bricks) {
        let to = 3u * (first + lane);
        ranges[to] = atomicLoad(&least[lane]);
        ranges[to + 1u] = atomicLoad(&most[lane]);
        ranges[to + 2u] = atomicLoad(&missing[lane]);
    }
    tell(lane);
}
