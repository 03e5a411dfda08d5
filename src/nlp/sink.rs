//! Where constraints and costs put their derivatives.
//!
//! A block adds each derivative as (row, variable, value). The first pass records the places; they become the sparsity
//! pattern. Every later pass makes the same calls in the same order, and each value is added to its stored slot, so the
//! pattern and the values cannot drift apart. The entries come in parts that can be evaluated separately.

use crate::trajectory::LinearNode;

/// Sorted unique places of a sparse matrix, and for each added entry, in order, the slot that it belongs to.
#[derive(Clone, Debug, Default)]
pub struct Pattern {
    /// Row of each slot.
    pub rows: Vec<i32>,
    /// Column of each slot.
    pub columns: Vec<i32>,
    slots: Vec<u32>,
    /// Where in `slots` each part starts, and where the last one ends.
    starts: Vec<usize>,
}

impl Pattern {
    /// Records the entries of `scatter`, in one part.
    pub fn record(mut scatter: impl FnMut(&mut Sink)) -> Self {
        Self::record_parts(1, |_, sink| scatter(sink))
    }

    /// Records the entries that `scatter` adds for each part number.
    pub fn record_parts(parts: usize, mut scatter: impl FnMut(usize, &mut Sink)) -> Self {
        let mut places = Vec::new();
        let mut starts = vec![0];
        for part in 0..parts {
            scatter(part, &mut Sink { mode: Mode::Record(&mut places) });
            starts.push(places.len());
        }
        Self { starts, ..Self::of(&places) }
    }

    /// Works row by row: there are about a hundred places to a slot, and sorting them all took a tenth of a solve.
    fn of(places: &[(u32, u32)]) -> Self {
        let size =
            |of: fn(&(u32, u32)) -> u32| places.iter().map(|place| of(place) as usize + 1).max().unwrap_or(0);
        let (rows, columns) = (size(|place| place.0), size(|place| place.1));
        let mut starts = vec![0usize; rows + 1];
        places.iter().for_each(|place| starts[place.0 as usize + 1] += 1);
        (0..rows).for_each(|row| starts[row + 1] += starts[row]);
        let mut by_row = vec![0u32; places.len()];
        let mut next = starts.clone();
        for (n, place) in places.iter().enumerate() {
            by_row[next[place.0 as usize]] = n as u32;
            next[place.0 as usize] += 1;
        }
        let mut pattern = Self { slots: vec![0; places.len()], ..Self::default() };
        let mut slot_of = vec![u32::MAX; columns];
        let mut unique: Vec<u32> = Vec::new();
        for row in 0..rows {
            let entries = &by_row[starts[row]..starts[row + 1]];
            for &n in entries {
                let column = places[n as usize].1;
                if std::mem::replace(&mut slot_of[column as usize], 0) == u32::MAX {
                    unique.push(column);
                }
            }
            unique.sort_unstable();
            for &column in &unique {
                slot_of[column as usize] = pattern.rows.len() as u32;
                pattern.rows.push(row as i32);
                pattern.columns.push(column as i32);
            }
            for &n in entries {
                pattern.slots[n as usize] = slot_of[places[n as usize].1 as usize];
            }
            unique.drain(..).for_each(|column| slot_of[column as usize] = u32::MAX);
        }
        pattern
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Number of entries that a part adds.
    pub fn entries(&self, part: usize) -> usize {
        self.starts[part + 1] - self.starts[part]
    }

    /// Overwrites `values`, one for each slot, with what `scatter` adds.
    pub fn fill(&self, values: &mut [f64], scatter: impl FnOnce(&mut Sink)) {
        values.fill(0.0);
        Self::replay(&self.slots, values, scatter);
    }

    /// Adds what `scatter` adds for some of the parts to `values`, one for each slot.
    pub fn add(&self, parts: &[usize], values: &mut [f64], mut scatter: impl FnMut(usize, &mut Sink)) {
        for &part in parts {
            let slots = &self.slots[self.starts[part]..self.starts[part + 1]];
            Self::replay(slots, values, |sink| scatter(part, sink));
        }
    }

    fn replay(slots: &[u32], values: &mut [f64], scatter: impl FnOnce(&mut Sink)) {
        let mut sink = Sink { mode: Mode::Fill { slots, values } };
        scatter(&mut sink);
        let Mode::Fill { slots, .. } = sink.mode else { unreachable!("the mode of a sink never changes") };
        assert!(slots.is_empty(), "a block added fewer entries than it had recorded");
    }
}

/// Takes derivatives: records their places, or adds their values.
pub struct Sink<'a> {
    mode: Mode<'a>,
}

enum Mode<'a> {
    /// Places are appended; values are ignored.
    Record(&'a mut Vec<(u32, u32)>),
    /// Values are added to the slots of the entries still to come.
    Fill { slots: &'a [u32], values: &'a mut [f64] },
}

/// The slots of some entries, and all values.
type NextSlots<'a> = (std::slice::Iter<'a, u32>, &'a mut [f64]);

impl Mode<'_> {
    /// The slots of the next `count` entries, and all values; while places are recorded, these.
    #[inline]
    fn next(&mut self, count: usize) -> Result<NextSlots<'_>, &mut Vec<(u32, u32)>> {
        match self {
            Self::Record(places) => Err(places),
            Self::Fill { slots, values } => {
                let (next, rest) = slots.split_at(count);
                *slots = rest;
                Ok((next.iter(), values))
            }
        }
    }
}

impl Sink<'_> {
    /// Adds `value` at (row, column).
    #[inline]
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        match self.mode.next(1) {
            Ok((slots, values)) => slots.for_each(|&slot| values[slot as usize] += value),
            Err(places) => places.push((row as u32, column as u32)),
        }
    }

    /// Takes the first derivatives of one row.
    #[inline]
    pub fn row(&mut self, row: usize) -> impl Differential {
        MatrixRow { sink: self, row }
    }

    /// Adds the derivative `value` of a row with respect to component `d` of a node.
    #[inline]
    pub fn node(&mut self, row: usize, node: &LinearNode, d: usize, value: f64) {
        let differential = node.differential(d);
        match self.mode.next(differential.len()) {
            Ok((slots, values)) => {
                for ((_, weight), &slot) in differential.zip(slots) {
                    values[slot as usize] += weight * value;
                }
            }
            Err(places) => differential.for_each(|(variable, _)| places.push((row as u32, variable as u32))),
        }
    }

    /// Adds the second derivative `value` with respect to component `a` of one node and component `b` of another *and* its
    /// mirror image, to the lower triangle. For the two halves of one node's own block, add each unordered pair once.
    #[inline]
    pub fn pair(&mut self, (node_a, a): (&LinearNode, usize), (node_b, b): (&LinearNode, usize), value: f64) {
        let (left, right) = (node_a.differential(a), || node_b.differential(b));
        match self.mode.next(left.len() * right().len()) {
            Ok((mut slots, values)) => {
                for (u, weight_a) in left {
                    for ((v, weight_b), &slot) in right().zip(&mut slots) {
                        let value = weight_a * weight_b * value;
                        values[slot as usize] += if u == v { 2.0 * value } else { value };
                    }
                }
            }
            Err(places) => left.for_each(|(u, _)| right().for_each(|(v, _)| places.push(lower(u, v)))),
        }
    }

    /// Adds the second derivative `value` with respect to components `a` and `b` of one and the same node, a ≥ b, once for
    /// each unordered pair (a, b), to the lower triangle.
    #[inline]
    pub fn own(&mut self, node: &LinearNode, a: usize, b: usize, value: f64) {
        if a != b {
            return self.pair((node, a), (node, b), value);
        }
        let all = || node.differential(a);
        match self.mode.next(all().len() * (all().len() + 1) / 2) {
            Ok((mut slots, values)) => {
                for (s, (_, weight_s)) in all().enumerate() {
                    for ((_, weight_t), &slot) in all().take(s + 1).zip(&mut slots) {
                        values[slot as usize] += weight_s * weight_t * value;
                    }
                }
            }
            Err(places) => all().enumerate().for_each(|(s, (u, _))| {
                all().take(s + 1).for_each(|(v, _)| places.push(lower(u, v)));
            }),
        }
    }
}

/// The place of (u, v) in the lower triangle.
fn lower(u: usize, v: usize) -> (u32, u32) {
    (u.max(v) as u32, u.min(v) as u32)
}

/// The first derivatives of one scalar: a row of a matrix, or a gradient.
pub trait Differential {
    /// Adds the derivative `value` with respect to component `d` of a node.
    fn node(&mut self, node: &LinearNode, d: usize, value: f64);
}

struct MatrixRow<'s, 'a> {
    sink: &'s mut Sink<'a>,
    row: usize,
}

impl Differential for MatrixRow<'_, '_> {
    #[inline]
    fn node(&mut self, node: &LinearNode, d: usize, value: f64) {
        self.sink.node(self.row, node, d, value);
    }
}

/// A dense gradient, one value for each variable.
pub struct Gradient<'a>(pub &'a mut [f64]);

impl Gradient<'_> {
    /// Adds the derivative `value` with respect to a variable.
    #[inline]
    pub fn add(&mut self, variable: usize, value: f64) {
        self.0[variable] += value;
    }
}

impl Differential for Gradient<'_> {
    #[inline]
    fn node(&mut self, node: &LinearNode, d: usize, value: f64) {
        node.differential(d).for_each(|(variable, weight)| self.0[variable] += weight * value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_land_where_they_were_declared() {
        let scatter = |scale: f64| {
            move |sink: &mut Sink| {
                sink.add(1, 2, scale);
                sink.add(0, 0, 2.0 * scale);
                sink.add(1, 2, 3.0 * scale);
            }
        };
        let pattern = Pattern::record(scatter(1.0));
        assert_eq!((&pattern.rows[..], &pattern.columns[..]), (&[0, 1][..], &[0, 2][..]));
        let mut values = [f64::NAN; 2];
        pattern.fill(&mut values, scatter(10.0));
        assert_eq!(values, [20.0, 40.0]);
    }

    /// f = (Σ w x)ᵀ A (Σ w x) has the Hessian W (A + Aᵀ) Wᵀ; `own` adds its lower triangle.
    #[test]
    fn a_node_with_shared_variables_gives_the_whole_hessian() {
        let node = LinearNode { terms: vec![(0, 0.25), (2, 0.75)], times: vec![] };
        let h = [[2.0, 0.5], [0.5, 3.0]];
        let scatter = |sink: &mut Sink| {
            for a in 0..2 {
                for b in 0..=a {
                    sink.own(&node, a, b, h[a][b]);
                }
            }
        };
        let pattern = Pattern::record(scatter);
        let mut values = vec![f64::NAN; pattern.len()];
        pattern.fill(&mut values, scatter);
        let w = [0.25, 0.25, 0.75, 0.75];
        let d = [0, 1, 0, 1];
        let mut seen = 0;
        for (slot, value) in values.iter().enumerate() {
            let (i, j) = (pattern.rows[slot] as usize, pattern.columns[slot] as usize);
            assert!(i >= j);
            assert!((value - w[i] * w[j] * h[d[i]][d[j]]).abs() < 1e-15, "({i}, {j})");
            seen += 1;
        }
        assert_eq!(seen, 10);
    }

    /// ½ ‖y_1 − y_0‖² of two nodes that share a switch, variable 4, has the Hessian (∇y_1 − ∇y_0)(∇y_1 − ∇y_0)ᵀ but for the
    /// nodes' own second derivatives.
    #[test]
    fn nodes_that_share_a_switch_give_the_whole_hessian() {
        let nodes = [
            LinearNode { terms: vec![(0, 0.5)], times: vec![(4, [2.0, -1.0, 0.0])] },
            LinearNode { terms: vec![(2, 3.0)], times: vec![(4, [0.5, 0.25, 0.0])] },
        ];
        let scatter = |sink: &mut Sink| {
            for d in 0..2 {
                sink.own(&nodes[0], d, d, 1.0);
                sink.own(&nodes[1], d, d, 1.0);
                sink.pair((&nodes[1], d), (&nodes[0], d), -1.0);
            }
        };
        let pattern = Pattern::record(scatter);
        let mut values = vec![f64::NAN; pattern.len()];
        pattern.fill(&mut values, scatter);
        // Rows: components; columns: variables.
        let gradient = [[-0.5, 0.0, 3.0, 0.0, -1.5], [0.0, -0.5, 0.0, 3.0, 1.25]];
        for (slot, value) in values.iter().enumerate() {
            let (i, j) = (pattern.rows[slot] as usize, pattern.columns[slot] as usize);
            let expected: f64 = gradient.iter().map(|g| g[i] * g[j]).sum();
            assert!((value - expected).abs() < 1e-15, "({i}, {j}): {value}, expected {expected}");
        }
        assert_eq!(values.len(), 11, "every place once");
    }
}
