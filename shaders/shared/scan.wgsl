// Running sums of whole numbers, each of those before it, in three steps: sums within chunks; the same of the chunks' sums, until one chunk is left; then each chunk's own is
// added to what it holds. No lane waits for another workgroup: not every device lets all of them go on.

struct Params {
    number: u32,
    len: u32,
}

@group(0) @binding(0) var<storage, read> params: Params;
@group(0) @binding(2) var<storage, read_write> values: array<u32>;
@group(0) @binding(3) var<storage, read_write> sums: array<u32>; // of each chunk

//#include shared/pass.wgsl

const EACH = 8u;
const CHUNK = 2048u;

//#if ADD
//#else
var<workgroup> upto: array<u32, 256>;
//#end

@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let chunk = place_in(group, groups);
//#if ADD
    for (var i = CHUNK * chunk + lane; i < min(CHUNK * (chunk + 1u), params.len); i += 256u) {
        values[i] += sums[chunk];
    }
//#else
    let start = CHUNK * chunk + EACH * lane;
    let end = min(start + EACH, params.len);
    var sum = 0u;
    for (var i = start; i < end; i++) {
        sum += values[i];
    }
    upto[lane] = sum;
    workgroupBarrier();
    for (var reach = 1u; reach < 256u; reach *= 2u) {
        var before = 0u;
        if (lane >= reach) {
            before = upto[lane - reach];
        }
        workgroupBarrier();
        upto[lane] += before;
        workgroupBarrier();
    }
    var running = upto[lane] - sum;
    for (var i = start; i < end; i++) {
        let own = values[i];
        values[i] = running;
        running += own;
    }
    if (lane == 255u && chunk < arrayLength(&sums)) {
        sums[chunk] = running;
    }
//#end
    tell(lane);
}
