//! Sparse symmetric matrices by their lower triangle.

/// The lower triangle by rows, columns ascending, every entry once. A row of a multiplier is one of Ipopt's Jacobian, whose entries come row by
/// row, so values go to places that follow each other.
#[derive(Debug)]
pub struct Symmetric {
    /// n + 1 places in `columns` and `values`.
    pub starts: Vec<usize>,
    pub columns: Vec<u32>,
    pub values: Vec<f64>,
    /// Where each given entry is added.
    slots: Vec<u32>,
}

impl Symmetric {
    /// The pattern of the given entries (row, column), of either triangle, each below n; values are zero.
    pub fn new(n: usize, entries: &[(u32, u32)]) -> Self {
        // Two stable bucket sorts: by column, then by row.
        let lower = |k: u32| {
            let (row, column) = entries[k as usize];
            (row.max(column), row.min(column))
        };
        let all: Vec<u32> = (0..entries.len() as u32).collect();
        let by_column = bucket_sort(n, &all, |k| lower(k).1);
        let order = bucket_sort(n, &by_column, |k| lower(k).0);

        let mut starts = vec![0; n + 1];
        let mut columns = Vec::with_capacity(entries.len());
        let mut slots = vec![0; entries.len()];
        let mut last = None;
        for &k in &order {
            let (row, column) = lower(k);
            if last != Some((row, column)) {
                last = Some((row, column));
                columns.push(column);
                starts[row as usize + 1] = columns.len();
            }
            slots[k as usize] = columns.len() as u32 - 1;
        }
        for row in 0..n {
            starts[row + 1] = starts[row + 1].max(starts[row]);
        }
        let values = vec![0.0; columns.len()];
        Self { starts, columns, values, slots }
    }

    pub fn dimension(&self) -> usize {
        self.starts.len() - 1
    }

    /// Sums up the given entries' values, in the order of the entries given to [`Symmetric::new`].
    pub fn assemble(&mut self, values: &[f64]) {
        self.values.fill(0.0);
        for (&slot, &value) in self.slots.iter().zip(values) {
            self.values[slot as usize] += value;
        }
    }

    /// The entries of a row: place, column.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, u32)> {
        (self.starts[row]..self.starts[row + 1]).map(|place| (place, self.columns[place]))
    }

    /// b − K x.
    pub fn residual(&self, b: &[f64], x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(b);
        for row in 0..self.dimension() {
            let (from, mut to) = (self.starts[row], self.starts[row + 1]);
            let x_row = x[row];
            let mut sum = 0.0;
            // The diagonal is the last entry.
            if from < to && self.columns[to - 1] as usize == row {
                to -= 1;
                sum = self.values[to] * x_row;
            }
            for (&column, &value) in self.columns[from..to].iter().zip(&self.values[from..to]) {
                sum += value * x[column as usize];
                out[column as usize] -= value * x_row;
            }
            out[row] -= sum;
        }
    }
}

/// Sorts `items` stably by a key below n.
pub fn bucket_sort(n: usize, items: &[u32], key: impl Fn(u32) -> u32) -> Vec<u32> {
    let mut starts = vec![0usize; n + 1];
    for &item in items {
        starts[key(item) as usize + 1] += 1;
    }
    for k in 0..n {
        starts[k + 1] += starts[k];
    }
    let mut sorted = vec![0; items.len()];
    for &item in items {
        let place = &mut starts[key(item) as usize];
        sorted[*place] = item;
        *place += 1;
    }
    sorted
}
