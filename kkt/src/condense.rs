//! Slacks and their multipliers eliminated from the matrix.
//!
//! The rows s and y_d of one inequality are
//!
//! ```text
//!   ⎡ σ  a ⎤ ⎡ s ⎤   ⎡ 0    ⎤   ⎡ b_s ⎤
//!   ⎣ a  d ⎦ ⎣ y ⎦ + ⎣ j·x  ⎦ = ⎣ b_y ⎦
//! ```
//!
//! with σ > 0, a = −1, d ≤ 0 in Ipopt's matrix, so that the 2×2 pivot has the determinant σd − a² ≤ −1: one positive and one negative
//! eigenvalue. Its elimination adds −σ/(σd − a²) j jᵀ to the block of x. Whatever the signs are, they are counted.

use crate::Layout;
use crate::symmetric::Symmetric;

/// An inequality's 2×2 pivot.
#[derive(Clone, Copy, Debug, Default)]
struct Pivot {
    sigma: f64,
    a: f64,
    d: f64,
}

impl Pivot {
    fn determinant(&self) -> f64 {
        self.sigma * self.d - self.a * self.a
    }
}

/// Inequalities that depend on the same variables.
#[derive(Debug)]
struct Group {
    /// Its inequalities are `order[first..first + count]`.
    first: usize,
    count: usize,
    /// Its variables are `columns[columns..columns + width]`, in ascending order of the reduced matrix.
    columns: usize,
    width: usize,
    /// Its coefficients begin here, row by row.
    coefficients: usize,
    /// Its width (width + 1)/2 places in the reduced matrix begin here, by columns of the lower triangle.
    places: usize,
}

/// What is eliminated, and where its traces go.
#[derive(Debug)]
pub struct Condenser {
    layout: Layout,
    /// Reduced index to index in the full matrix.
    kept: Vec<u32>,
    groups: Vec<Group>,
    /// Inequalities in the order of the groups.
    order: Vec<u32>,
    columns: Vec<u32>,
    places: Vec<u32>,
    /// From a value of the full matrix to a place in the reduced one.
    copies: Vec<(u32, u32)>,
    /// From a value of the full matrix to a coefficient.
    coefficient_sources: Vec<u32>,
    /// The full matrix's values σ, a, d of each inequality in `order`; [`NONE`] for no entry.
    pivot_sources: Vec<[u32; 3]>,
    coefficients: Vec<f64>,
    pivots: Vec<Pivot>,
    weights: Vec<f64>,
    /// A number for each of a group's variables.
    sums: Vec<f64>,
}

const NONE: u32 = u32::MAX;

/// [`Condenser::add_products`] as pulp calls it.
struct AddProducts<'a> {
    condenser: &'a mut Condenser,
    reduced: &'a mut [f64],
}

impl pulp::NullaryFnOnce for AddProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.condenser.add_products(self.reduced);
    }
}

/// The inequalities of a matrix, as its pattern tells them; `None` if it is not what [`Layout`] describes, so that nothing can be condensed.
struct Inequalities {
    /// Of each inequality, the coefficients: column, place in the full matrix.
    rows: Vec<Vec<(u32, u32)>>,
    pivots: Vec<[u32; 3]>,
}

fn inequalities(matrix: &Symmetric, layout: Layout) -> Option<Inequalities> {
    let Layout { variables: n, inequalities: m, equations } = layout;
    let first_multiplier = n + m + equations;
    let mut rows = vec![Vec::new(); m];
    let mut pivots = vec![[NONE; 3]; m];
    for row in 0..matrix.dimension() {
        for (place, column) in matrix.row(row) {
            let (column, place) = (column as usize, place as u32);
            if (n..n + m).contains(&column) {
                // A slack meets itself and its own multiplier only.
                let k = column - n;
                match row {
                    _ if row == column => pivots[k][0] = place,
                    _ if row == first_multiplier + k => pivots[k][1] = place,
                    _ => return None,
                }
            } else if row >= first_multiplier {
                // A multiplier of an inequality meets variables and itself.
                let k = row - first_multiplier;
                if row == column {
                    pivots[k][2] = place;
                } else if column < n {
                    rows[k].push((column as u32, place));
                } else {
                    return None;
                }
            } else if (n..n + m).contains(&row) {
                return None;
            }
        }
    }
    pivots.iter().all(|pivot| pivot[1] != NONE).then_some(Inequalities { rows, pivots })
}

/// The lower triangle of the reduced matrix's pattern by columns, rows ascending.
pub struct Pattern {
    pub starts: Vec<usize>,
    pub rows: Vec<u32>,
}

impl Condenser {
    /// Finds what can be eliminated, and the pattern of what remains: in ascending order the full matrix's other rows. Nothing is
    /// eliminated if the pattern of the matrix contradicts the layout.
    pub fn new(matrix: &Symmetric, layout: Layout) -> (Self, Pattern) {
        let found = inequalities(matrix, layout);
        let condensed = found.is_some();
        let Inequalities { rows, pivots } =
            found.unwrap_or(Inequalities { rows: Vec::new(), pivots: Vec::new() });
        let (n, m) = (layout.variables, rows.len());
        let kept: Vec<u32> = if condensed {
            let equations = n + m..n + m + layout.equations;
            (0..n).chain(equations).map(|i| i as u32).collect()
        } else {
            (0..layout.dimension() as u32).collect()
        };
        let reduced = kept.len();
        let mut reduced_of = vec![NONE; layout.dimension()];
        for (new, &old) in kept.iter().enumerate() {
            reduced_of[old as usize] = new as u32;
        }

        // Inequalities with the same variables go together. Variables keep their numbers.
        let mut order: Vec<u32> = (0..m as u32).collect();
        let variables = |k: u32| rows[k as usize].iter().map(|&(column, _)| column);
        order.sort_by(|&a, &b| variables(a).cmp(variables(b)));
        let mut groups: Vec<Group> = Vec::new();
        let (mut columns, mut coefficient_sources) = (Vec::new(), Vec::new());
        let mut num_places = 0;
        for (position, &k) in order.iter().enumerate() {
            let joins = groups.last().is_some_and(|group| variables(order[group.first]).eq(variables(k)));
            if joins {
                groups.last_mut().expect("there is a last group").count += 1;
            } else {
                let width = rows[k as usize].len();
                groups.push(Group {
                    first: position,
                    count: 1,
                    columns: columns.len(),
                    width,
                    coefficients: coefficient_sources.len(),
                    places: num_places,
                });
                columns.extend(variables(k));
                num_places += width * (width + 1) / 2;
            }
            coefficient_sources.extend(rows[k as usize].iter().map(|&(_, place)| place));
        }

        let widest = groups.iter().map(|group| group.width).max().unwrap_or(0);
        let mut condenser = Self {
            layout,
            kept,
            groups,
            pivot_sources: order.iter().map(|&k| pivots[k as usize]).collect(),
            order,
            columns,
            places: vec![0; num_places],
            copies: Vec::new(),
            coefficients: vec![0.0; coefficient_sources.len()],
            coefficient_sources,
            pivots: vec![Pivot::default(); m],
            weights: vec![0.0; m],
            sums: vec![0.0; widest],
        };
        let pattern = condenser.fill(matrix, &reduced_of, reduced);
        (condenser, pattern)
    }

    /// The pattern of the reduced matrix, with the places of copies and groups in it.
    fn fill(&mut self, matrix: &Symmetric, reduced_of: &[u32], reduced: usize) -> Pattern {
        // Which groups each column belongs to, and where in the group.
        let mut memberships: Vec<Vec<(u32, u32)>> = vec![Vec::new(); reduced];
        for (g, group) in self.groups.iter().enumerate() {
            for (t, &column) in self.columns[group.columns..][..group.width].iter().enumerate() {
                memberships[column as usize].push((g as u32, t as u32));
            }
        }
        // The entries that are copied, by columns.
        let mut below: Vec<Vec<(u32, u32)>> = vec![Vec::new(); reduced];
        for (row, &old) in self.kept.iter().enumerate() {
            for (source, column) in matrix.row(old as usize) {
                if let Some(below) = below.get_mut(reduced_of[column as usize] as usize) {
                    below.push((source as u32, row as u32));
                }
            }
        }
        let mut pattern = Pattern { starts: vec![0], rows: Vec::new() };
        let mut place_of = vec![0; reduced];
        let mut seen = vec![NONE; reduced];
        for column in 0..reduced {
            let from = pattern.rows.len();
            let mut take = |row: u32| {
                if seen[row as usize] != column as u32 {
                    seen[row as usize] = column as u32;
                    pattern.rows.push(row);
                }
            };
            take(column as u32);
            below[column].iter().for_each(|&(_, row)| take(row));
            for &(g, t) in &memberships[column] {
                let group = &self.groups[g as usize];
                self.columns[group.columns..][..group.width][t as usize..].iter().for_each(|&row| take(row));
            }
            pattern.rows[from..].sort_unstable();
            for (place, &row) in pattern.rows.iter().enumerate().skip(from) {
                place_of[row as usize] = place as u32;
            }
            self.copies.extend(below[column].iter().map(|&(source, row)| (source, place_of[row as usize])));
            for &(g, t) in &memberships[column] {
                let (group, t) = (&self.groups[g as usize], t as usize);
                let rows = &self.columns[group.columns..][..group.width][t..];
                let first = group.places + t * group.width - t * t.saturating_sub(1) / 2;
                for (place, &row) in self.places[first..].iter_mut().zip(rows) {
                    *place = place_of[row as usize];
                }
            }
            pattern.starts.push(pattern.rows.len());
        }
        pattern
    }

    /// Tells where each place of the pattern has gone.
    pub fn relocate(&mut self, new_place: &[u32]) {
        for place in &mut self.places {
            *place = new_place[*place as usize];
        }
        for (_, place) in &mut self.copies {
            *place = new_place[*place as usize];
        }
        self.copies.sort_unstable_by_key(|&(_, place)| place);
    }

    /// How many inequalities are condensed.
    pub fn num_condensed(&self) -> usize {
        self.order.len()
    }

    /// Reduced index to index in the full matrix.
    pub fn kept(&self) -> &[u32] {
        &self.kept
    }

    /// Eliminates: fills the reduced matrix and returns the number of negative eigenvalues of all pivots; `None` if one of them is singular or not
    /// finite.
    pub fn reduce(&mut self, full: &[f64], reduced: &mut [f64]) -> Option<usize> {
        reduced.fill(0.0);
        for &(source, place) in &self.copies {
            reduced[place as usize] += full[source as usize];
        }
        for (coefficient, &source) in self.coefficients.iter_mut().zip(&self.coefficient_sources) {
            *coefficient = full[source as usize];
        }
        let value = |source: u32| if source == NONE { 0.0 } else { full[source as usize] };
        let mut negative = 0;
        for ((pivot, weight), sources) in
            self.pivots.iter_mut().zip(&mut self.weights).zip(&self.pivot_sources)
        {
            let [sigma, a, d] = sources.map(value);
            *pivot = Pivot { sigma, a, d };
            let determinant = pivot.determinant();
            negative += match determinant {
                _ if determinant < 0.0 => 1,
                _ if determinant > 0.0 => 2 * usize::from(sigma < 0.0),
                _ => return None,
            };
            *weight = -sigma / determinant;
        }
        // With the widest vectors that the processor has.
        pulp::Arch::new().dispatch(AddProducts { condenser: self, reduced });
        Some(negative)
    }

    /// Adds Σ weight · j jᵀ over all inequalities, group by group: a group's sum is dense.
    #[inline(always)]
    fn add_products(&mut self, reduced: &mut [f64]) {
        for group in &self.groups {
            let (width, weights) = (group.width, &self.weights[group.first..][..group.count]);
            let rows = &self.coefficients[group.coefficients..][..group.count * width];
            let mut places = &self.places[group.places..];
            for t in 0..width {
                let sums = &mut self.sums[..width - t];
                sums.fill(0.0);
                let (pairs, pair_weights) = (rows.chunks_exact(2 * width), weights.chunks_exact(2));
                if let ([weight], row) = (pair_weights.remainder(), pairs.remainder()) {
                    let factor = weight * row[t];
                    for (sum, coefficient) in sums.iter_mut().zip(&row[t..]) {
                        *sum = factor * coefficient;
                    }
                }
                for (rows, weights) in pairs.zip(pair_weights) {
                    let (first, second) = rows.split_at(width);
                    let factors = [weights[0] * first[t], weights[1] * second[t]];
                    for ((sum, a), b) in sums.iter_mut().zip(&first[t..]).zip(&second[t..]) {
                        *sum += factors[0] * a + factors[1] * b;
                    }
                }
                let (these, rest) = places.split_at(width - t);
                places = rest;
                for (&place, &sum) in these.iter().zip(&*sums) {
                    reduced[place as usize] += sum;
                }
            }
        }
    }

    /// The right-hand side of the reduced system.
    pub fn restrict(&mut self, full: &[f64], reduced: &mut [f64]) {
        for (value, &old) in reduced.iter_mut().zip(&self.kept) {
            *value = full[old as usize];
        }
        pulp::Arch::new().dispatch(Restrict { condenser: self, full, reduced });
    }

    /// The solution of the full system, of which `full` is still the right-hand side, from that of the reduced one.
    pub fn expand(&mut self, reduced: &[f64], full: &mut [f64]) {
        pulp::Arch::new().dispatch(Expand { condenser: self, reduced, full });
        for (&value, &old) in reduced.iter().zip(&self.kept) {
            full[old as usize] = value;
        }
    }

    /// Calls with each group: its columns, numbers for them, and of its inequalities the coefficients, the pivots, and the rows s and y in the
    /// full matrix.
    #[inline(always)]
    fn for_each_group(&mut self, mut visit: impl FnMut(&[u32], &mut [f64], Rows<'_>)) {
        let Layout { variables, inequalities, equations } = self.layout;
        for group in &self.groups {
            let range = group.first..group.first + group.count;
            let rows = Rows {
                coefficients: &self.coefficients[group.coefficients..][..group.count * group.width],
                pivots: &self.pivots[range.clone()],
                order: &self.order[range],
                slacks: variables,
                multipliers: variables + inequalities + equations,
            };
            visit(&self.columns[group.columns..][..group.width], &mut self.sums[..group.width], rows);
        }
    }
}

/// The inequalities of a group.
struct Rows<'a> {
    coefficients: &'a [f64],
    pivots: &'a [Pivot],
    order: &'a [u32],
    /// Where the rows s and y_d begin.
    slacks: usize,
    multipliers: usize,
}

impl<'a> Rows<'a> {
    /// The pivot, the rows s and y in the full matrix, and the coefficients of each.
    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = (&'a Pivot, [usize; 2], &'a [f64])> {
        let width = (self.coefficients.len() / self.order.len()).max(1);
        // An inequality without variables has no coefficients.
        let none: &[f64] = &[];
        let rows = self.coefficients.chunks_exact(width).chain(std::iter::repeat(none));
        let (slacks, multipliers) = (self.slacks, self.multipliers);
        self.pivots
            .iter()
            .zip(self.order)
            .zip(rows)
            .map(move |((pivot, &k), row)| (pivot, [slacks + k as usize, multipliers + k as usize], row))
    }
}

/// [`Condenser::restrict`] as pulp calls it: a group's sum is dense.
struct Restrict<'a> {
    condenser: &'a mut Condenser,
    full: &'a [f64],
    reduced: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Restrict<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { condenser, full, reduced } = self;
        condenser.for_each_group(|columns, sums, rows| {
            sums.fill(0.0);
            for (pivot, [slack, multiplier], row) in rows.iter() {
                let y = (pivot.sigma * full[multiplier] - pivot.a * full[slack]) / pivot.determinant();
                for (sum, coefficient) in sums.iter_mut().zip(row) {
                    *sum += coefficient * y;
                }
            }
            for (&column, sum) in columns.iter().zip(sums) {
                reduced[column as usize] -= *sum;
            }
        });
    }
}

/// [`Condenser::expand`] as pulp calls it.
struct Expand<'a> {
    condenser: &'a mut Condenser,
    reduced: &'a [f64],
    full: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Expand<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { condenser, reduced, full } = self;
        condenser.for_each_group(|columns, values, rows| {
            for (value, &column) in values.iter_mut().zip(columns) {
                *value = reduced[column as usize];
            }
            for (pivot, [slack, multiplier], row) in rows.iter() {
                let (b_s, b_y) = (full[slack], full[multiplier] - dot(row, values));
                let determinant = pivot.determinant();
                full[slack] = (pivot.d * b_s - pivot.a * b_y) / determinant;
                full[multiplier] = (pivot.sigma * b_y - pivot.a * b_s) / determinant;
            }
        });
    }
}

/// a · b, in as many sums as the widest vector has numbers.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b[..a.len()].as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}
