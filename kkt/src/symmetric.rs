//! Sparse symmetric matrices by their lower triangle.

/// The lower triangle by columns, rows ascending, every entry once.
#[derive(Debug)]
pub struct Symmetric {
    /// n + 1 places in `rows` and `values`.
    pub starts: Vec<usize>,
    pub rows: Vec<u32>,
    pub values: Vec<f64>,
    /// Where each given entry is added.
    slots: Vec<u32>,
}

impl Symmetric {
    /// The pattern of the given entries (row, column), of either triangle, each below n; values are zero.
    pub fn new(n: usize, entries: &[(u32, u32)]) -> Self {
        // Two stable bucket sorts: by row, then by column.
        let lower = |k: u32| {
            let (row, column) = entries[k as usize];
            (row.max(column), row.min(column))
        };
        let all: Vec<u32> = (0..entries.len() as u32).collect();
        let by_row = bucket_sort(n, &all, |k| lower(k).0);
        let order = bucket_sort(n, &by_row, |k| lower(k).1);

        let mut starts = vec![0; n + 1];
        let mut rows = Vec::with_capacity(entries.len());
        let mut slots = vec![0; entries.len()];
        let mut last = None;
        for &k in &order {
            let (row, column) = lower(k);
            if last != Some((row, column)) {
                last = Some((row, column));
                rows.push(row);
                starts[column as usize + 1] = rows.len();
            }
            slots[k as usize] = rows.len() as u32 - 1;
        }
        for column in 0..n {
            starts[column + 1] = starts[column + 1].max(starts[column]);
        }
        let values = vec![0.0; rows.len()];
        Self { starts, rows, values, slots }
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

    /// The entries of a column: place, row.
    pub fn column(&self, column: usize) -> impl Iterator<Item = (usize, u32)> {
        (self.starts[column]..self.starts[column + 1]).map(|place| (place, self.rows[place]))
    }

    /// b − K x.
    pub fn residual(&self, b: &[f64], x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(b);
        for column in 0..self.dimension() {
            let (from, to) = (self.starts[column], self.starts[column + 1]);
            let x_column = x[column];
            let mut sum = 0.0;
            for (&row, &value) in self.rows[from..to].iter().zip(&self.values[from..to]) {
                let row = row as usize;
                if row == column {
                    sum += value * x_column;
                } else {
                    sum += value * x[row];
                    out[row] -= value * x_column;
                }
            }
            out[column] -= sum;
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
