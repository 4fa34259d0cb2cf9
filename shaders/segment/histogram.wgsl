// How often each stored value of 8 or 16 bits occurs: histogram.rs. Sums of whole numbers are the same in any order.

struct Params {
    number: u32,
    voxels: u32,
    first: u32, // the first quad of voxels of this part, and one after its last
    end: u32,
    page: u32, // of values of 16 bits: which 4096 of them
}

@group(0) @binding(0) var<storage, read> params: Params;
@group(0) @binding(2) var<storage, read> volume: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;
//#if MASKED
@group(0) @binding(4) var<storage, read> mask: array<u32>;
//#end

//#include shared/pass.wgsl
//#include shared/stored.wgsl

// Quads that a lane counts, one after the other; those of a workgroup lie side by side.
//#if BYTES
const QUADS = 32u;
// Four tables: lanes beside each other seldom wait for each other.
const SLOTS = 1024u;
//#else
const QUADS = 256u;
// A page of the values of 16 bits.
const PAGE = 4096u;
//#if PAGES
// How many values there are in each page, in 64 tables.
const SLOTS = 1024u;
//#else
const SLOTS = PAGE;
//#end
//#end

var<workgroup> table: array<atomic<u32>, SLOTS>;

fn add(r: u32, n: u32, lane: u32) {
//#if BYTES
    if (n > 0u) {
        atomicAdd(&table[4u * r + (lane & 3u)], n);
    }
//#else
//#if PAGES
    if (n > 0u) {
        atomicAdd(&table[64u * (r / PAGE) + (lane & 63u)], n);
    }
//#else
    let slot = r - PAGE * params.page;
    if (n > 0u && slot < SLOTS) {
        atomicAdd(&table[slot], n);
    }
//#end
//#end
}

@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    for (var i = lane; i < SLOTS; i += 256u) {
        atomicStore(&table[i], 0u);
    }
    workgroupBarrier();
    let start = params.first + 256u * QUADS * place_in(group, groups);
    // Equal values one after the other are added at once.
    var value = 0u;
    var run = 0u;
    for (var k = 0u; k < QUADS; k++) {
        let quad = start + 256u * k + lane;
        if (quad >= params.end) {
            break;
        }
        let r = ranks(quad);
//#if MASKED
        let inside = mask[quad];
//#end
        for (var j = 0u; j < 4u; j++) {
            var counts_one = 4u * quad + j < params.voxels;
//#if MASKED
            counts_one = counts_one && ((inside >> (8u * j)) & 0xffu) != 0u;
//#end
            if (counts_one) {
                if (r[j] != value) {
                    add(value, run, lane);
                    value = r[j];
                    run = 0u;
                }
                run += 1u;
            }
        }
    }
    add(value, run, lane);
    workgroupBarrier();
//#if BYTES
    let sum = atomicLoad(&table[4u * lane]) + atomicLoad(&table[4u * lane + 1u]) + atomicLoad(&table[4u * lane + 2u]) + atomicLoad(&table[4u * lane + 3u]);
    if (sum > 0u) {
        atomicAdd(&counts[lane], sum);
    }
//#else
//#if PAGES
    for (var i = lane; i < SLOTS; i += 256u) {
        let sum = atomicLoad(&table[i]);
        if (sum > 0u) {
            atomicAdd(&counts[i / 64u], sum);
        }
    }
//#else
    for (var i = lane; i < SLOTS; i += 256u) {
        let sum = atomicLoad(&table[i]);
        if (sum > 0u) {
            atomicAdd(&counts[PAGE * params.page + i], sum);
        }
    }
//#end
//#end
    tell(lane);
}
