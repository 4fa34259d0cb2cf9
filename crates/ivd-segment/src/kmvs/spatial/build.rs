//! One brick of the hierarchy: its voxels in order, cut into groups.

use ivd_core::{Mask, Scalar};

use super::brick::{Brick, GROUP, Places};
use super::frame::{Frame, is_short};
use super::layout::Layout;

/// Bits of the keys that voxels are ordered by.
const KEY_BITS: u32 = 11;
const KEYS: usize = 1 << KEY_BITS;
/// Halvings that bring a full brick down to groups.
const HALVINGS: u32 = 6;

/// Where a brick's members and groups go.
pub(super) struct Room<'a, T> {
    pub(super) first: usize,
    pub(super) first_group: usize,
    pub(super) places: &'a mut [u16],
    pub(super) values: &'a mut [T],
    pub(super) group_places: &'a mut [Places],
    pub(super) group_values: &'a mut [[f64; 2]],
    pub(super) group_sums: &'a mut [i64],
}

impl<T> Room<'_, T> {
    /// Divides room for everything into room for bricks of so many voxels.
    pub(super) fn split(self, extents: &[usize]) -> Vec<Self> {
        let mut rest = self;
        let mut rooms = Vec::with_capacity(extents.len());
        for &voxels in extents {
            let groups = voxels.div_ceil(GROUP);
            let (places, more_places) = rest.places.split_at_mut(voxels);
            let (values, more_values) = rest.values.split_at_mut(voxels);
            let (group_places, more_group_places) = rest.group_places.split_at_mut(groups);
            let (group_values, more_group_values) = rest.group_values.split_at_mut(groups);
            let (group_sums, more_group_sums) = rest.group_sums.split_at_mut(groups);
            let (first, first_group) = (rest.first, rest.first_group);
            rooms.push(Self { first, first_group, places, values, group_places, group_values, group_sums });
            rest = Self {
                first: first + voxels,
                first_group: first_group + groups,
                places: more_places,
                values: more_values,
                group_places: more_group_places,
                group_values: more_group_values,
                group_sums: more_group_sums,
            };
        }
        rooms
    }
}

/// Memory that one thread uses for brick after brick.
#[derive(Default)]
pub(super) struct Scratch<T> {
    places: Vec<u16>,
    values: Vec<T>,
    fixed: Vec<i64>,
    keys: Vec<u16>,
    ordered: Vec<i64>,
    template: Option<Template>,
}

/// A full brick of one value: all of them have the same places, in the same groups.
struct Template {
    places: Vec<u16>,
    groups: Vec<Places>,
    brick: Brick,
}

/// Fills the room of a brick. Also gives the sums of squared voxel indices of its members.
pub(super) fn build<T: Scalar>(
    voxels: &[T],
    mask: Option<&Mask>,
    frame: &Frame,
    (layout, index): (&Layout, usize),
    scratch: &mut Scratch<T>,
    room: &mut Room<T>,
) -> (Brick, [i128; 3]) {
    let (origin, edges) = layout.brick(index);
    let constant = constant(voxels, mask, layout, (origin, edges));
    if let (Some(value), Some(template)) = (constant, &scratch.template) {
        let brick = template.fill(frame, value, origin, room);
        return (brick, squares_of_indices(origin, edges, &brick, &[], layout));
    }
    scratch.gather(voxels, mask, frame, layout, (origin, edges));
    let count = scratch.places.len();
    let mut brick = Brick {
        origin,
        first: room.first,
        first_group: room.first_group,
        count,
        whole: count == edges.iter().product::<usize>(),
        low: [u8::MAX; 3],
        high: [0; 3],
        values: [f64::INFINITY, f64::NEG_INFINITY],
        sums: [0; 3],
        value_sum: 0,
        value_squares: 0,
    };
    scratch.order(frame, layout, room.places, room.values);
    for group in 0..count.div_ceil(GROUP) {
        let members = group * GROUP..count.min((group + 1) * GROUP);
        let places = summary(layout, &room.places[members.clone()]);
        let fixed = &scratch.ordered[members.clone()];
        let values = range(frame, &room.values[members]);
        let sum: i64 = fixed.iter().sum();
        for a in 0..3 {
            brick.low[a] = brick.low[a].min(places[a] as u8);
            brick.high[a] = brick.high[a].max(places[3 + a] as u8);
            brick.sums[a] += u32::from(places[6 + a]);
        }
        brick.values = [brick.values[0].min(values[0]), brick.values[1].max(values[1])];
        brick.value_sum += sum;
        brick.value_squares += squares_of::<T>(fixed);
        room.group_places[group] = places;
        room.group_values[group] = values;
        room.group_sums[group] = sum;
    }
    if constant.is_some() {
        let groups = room.group_places[..count.div_ceil(GROUP)].to_vec();
        scratch.template = Some(Template { places: room.places.to_vec(), groups, brick });
    }
    (brick, squares_of_indices(origin, edges, &brick, &scratch.places, layout))
}

/// The value of a full brick, all of it data inside the mask, that holds only one.
fn constant<T: Scalar>(
    voxels: &[T],
    mask: Option<&Mask>,
    layout: &Layout,
    (origin, edges): ([usize; 3], [usize; 3]),
) -> Option<T> {
    if mask.is_some() || (0..3).any(|a| edges[a] != 1 << layout.log[a]) {
        return None;
    }
    let value = voxels[layout.linear(origin)];
    let equal = |(y, z): (usize, usize)| {
        let start = layout.linear([origin[0], origin[1] + y, origin[2] + z]);
        voxels[start..start + edges[0]].iter().all(|v| *v == value)
    };
    let mut rows = (0..edges[2]).flat_map(|z| (0..edges[1]).map(move |y| (y, z)));
    (value.is_data() && rows.all(equal)).then_some(value)
}

impl Template {
    fn fill<T: Scalar>(&self, frame: &Frame, value: T, origin: [usize; 3], room: &mut Room<T>) -> Brick {
        room.places.copy_from_slice(&self.places);
        room.values.fill(value);
        room.group_places[..self.groups.len()].copy_from_slice(&self.groups);
        let relative = frame.relative(value);
        let fixed = frame.fixed(relative);
        let count = self.places.len();
        room.group_values.fill([relative; 2]);
        for (group, sum) in room.group_sums.iter_mut().enumerate() {
            *sum = fixed * (count - group * GROUP).min(GROUP) as i64;
        }
        Brick {
            origin,
            first: room.first,
            first_group: room.first_group,
            values: [relative; 2],
            value_sum: fixed * count as i64,
            value_squares: i128::from(fixed) * i128::from(fixed) * count as i128,
            ..self.brick
        }
    }
}

impl<T: Scalar> Scratch<T> {
    /// Collects a brick's members in the order of their places.
    fn gather(
        &mut self,
        voxels: &[T],
        mask: Option<&Mask>,
        frame: &Frame,
        layout: &Layout,
        (origin, edges): ([usize; 3], [usize; 3]),
    ) {
        self.places.clear();
        self.values.clear();
        for z in 0..edges[2] {
            for y in 0..edges[1] {
                let start = layout.linear([origin[0], origin[1] + y, origin[2] + z]);
                let row = &voxels[start..start + edges[0]];
                let place = layout.pack([0, y, z]);
                if mask.is_none() && T::TYPE.is_integer() {
                    self.values.extend_from_slice(row);
                    self.places.extend((0..edges[0] as u16).map(|x| place + x));
                    continue;
                }
                let inside = mask.map(|m| &m.inside()[start..start + edges[0]]);
                for (x, &v) in row.iter().enumerate() {
                    if v.is_data() && inside.is_none_or(|m| m[x] != 0) {
                        self.values.push(v);
                        self.places.push(place + x as u16);
                    }
                }
            }
        }
        self.fixed.clear();
        self.fixed.extend(self.values.iter().map(|v| frame.fixed(frame.relative(*v))));
    }

    /// Orders the members by their keys (a counting sort), those of one key by place.
    fn order(&mut self, frame: &Frame, layout: &Layout, places: &mut [u16], values: &mut [T]) {
        self.set_keys(frame, layout);
        let mut ends = [0_u32; KEYS + 1];
        for &key in &self.keys {
            ends[usize::from(key) % KEYS + 1] += 1;
        }
        let mut total = 0;
        for end in &mut ends {
            total += *end;
            *end = total;
        }
        for ((&key, &place), &value) in self.keys.iter().zip(&self.places).zip(&self.values) {
            let to = &mut ends[usize::from(key) % KEYS];
            let at = *to as usize;
            *to += 1;
            places[at] = place;
            values[at] = value;
        }
        let values = &values[..self.places.len()];
        self.ordered.clear();
        self.ordered.extend(values.iter().map(|v| frame.fixed(frame.relative(*v))));
    }

    /// The key of a member: which part of the brick, then which part of the brick's range of values. The brick is halved
    /// along its widest side in feature space until the parts are as many as its groups (as a k-d tree would be).
    fn set_keys(&mut self, frame: &Frame, layout: &Layout) {
        let (mut least, mut most) = (i64::MAX, i64::MIN);
        for &v in &self.fixed {
            least = least.min(v);
            most = most.max(v);
        }
        let span = most.saturating_sub(least).max(0) as u64;
        let halvings = halvings(frame, layout, span);
        let cells: u32 = halvings.iter().sum();
        let shift = (u64::BITS - span.leading_zeros()).saturating_sub(KEY_BITS - cells);
        let bucket = |v: i64| ((v - least) as u64 >> shift) as u16;
        self.keys.clear();
        if cells == 0 {
            self.keys.extend(self.fixed.iter().map(|v| bucket(*v)));
            return;
        }
        let cut: [u32; 3] = std::array::from_fn(|a| layout.log[a] - halvings[a]);
        let cell = |place: u16| {
            let [x, y, z] = layout.unpack(place);
            ((z >> cut[2]) << halvings[1] | y >> cut[1]) << halvings[0] | x >> cut[0]
        };
        let key = |(place, v): (&u16, &i64)| (cell(*place) << (KEY_BITS - cells)) as u16 | bucket(*v);
        self.keys.extend(self.places.iter().zip(&self.fixed).map(key));
    }
}

/// How often each axis of a brick is halved before its values are, whose range in fixed point is `span`.
fn halvings(frame: &Frame, layout: &Layout, span: u64) -> [u32; 3] {
    let mut sides: [f64; 4] = [0.0, 0.0, 0.0, frame.width(span)];
    for a in 0..3 {
        // The feature of an index is proportional to it; an axis of one voxel has none.
        sides[a] = frame.axes[a].get(1).copied().unwrap_or(0.0) * (1_u32 << layout.log[a]) as f64;
    }
    let mut halved = [0; 4];
    for _ in 0..HALVINGS {
        let open = (0..4).filter(|&a| a == 3 || halved[a] < layout.log[a]);
        // The value comes last, and so wins among equals.
        let Some(widest) = open.max_by(|a, b| sides[*a].total_cmp(&sides[*b])) else { break };
        halved[widest] += 1;
        sides[widest] /= 2.0;
    }
    [halved[0], halved[1], halved[2]]
}

/// Box and sums of places.
fn summary(layout: &Layout, places: &[u16]) -> Places {
    let [x, y, _] = layout.log;
    // Signed 16 bit: least and largest of eight at once on any x86-64.
    let axis = |shift: u32, bits: u32| {
        let mask = (1_i16 << bits) - 1;
        let (mut low, mut high, mut sum) = (i16::MAX, 0_i16, 0_i16);
        for &place in places {
            let at = (place >> shift) as i16 & mask;
            low = low.min(at);
            high = high.max(at);
            sum += at;
        }
        [low as u16, high as u16, sum as u16]
    };
    let [a, b, c] = [axis(0, x), axis(x, y), axis(x + y, layout.log[2])];
    [a[0], b[0], c[0], a[1], b[1], c[1], a[2], b[2], c[2]]
}

fn range<T: Scalar>(frame: &Frame, values: &[T]) -> [f64; 2] {
    let (mut low, mut high) = (values[0], values[0]);
    for &v in values {
        low = if v < low { v } else { low };
        high = if v > high { v } else { high };
    }
    [frame.relative(low), frame.relative(high)]
}

/// Sum of squares of fixed-point values of type `T`.
#[inline]
pub(super) fn squares_of<T: Scalar>(fixed: &[i64]) -> i128 {
    if is_short::<T>() {
        i128::from(fixed.iter().map(|v| v * v).sum::<i64>())
    } else {
        fixed.iter().map(|v| i128::from(*v) * i128::from(*v)).sum()
    }
}

/// Sums of squared voxel indices of a brick's members, whose places are needed unless the brick is whole.
fn squares_of_indices(
    origin: [usize; 3],
    edges: [usize; 3],
    brick: &Brick,
    places: &[u16],
    layout: &Layout,
) -> [i128; 3] {
    let mut squares = [0_u64; 3];
    if brick.whole {
        for a in 0..3 {
            let line: usize = (0..edges[a]).map(|i| i * i).sum();
            squares[a] = (line * (brick.count / edges[a])) as u64;
        }
    } else {
        for &place in places {
            let at = layout.unpack(place);
            (0..3).for_each(|a| squares[a] += (at[a] * at[a]) as u64);
        }
    }
    std::array::from_fn(|a| {
        let from = origin[a] as i128;
        i128::from(squares[a]) + 2 * from * i128::from(brick.sums[a]) + from * from * brick.count as i128
    })
}
