//! LDLᵀ of a sparse symmetric matrix in a fixed order, by faer's supernodal routines.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{simplicial, supernodal};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Spec};

use crate::condense::Pattern;
use crate::kkt::Error;

/// A pivot smaller than this is replaced by one of [`LEAST_PIVOT`] with its sign. Entries of the matrix are of order one.
const TINY_PIVOT: f64 = 1e-12;
/// See [`TINY_PIVOT`].
const LEAST_PIVOT: f64 = 1e-8;

/// The pattern in the order of elimination, and the factors' values.
pub struct Ldlt {
    /// New index to old.
    order: Vec<u32>,
    symbolic: supernodal::SymbolicSupernodalCholesky<u32>,
    /// The lower triangle by columns, in the new order.
    starts: Vec<u32>,
    rows: Vec<u32>,
    /// Its values, to be filled before [`Ldlt::factor`].
    pub values: Vec<f64>,
    factors: Vec<f64>,
    work: MemBuffer,
    permuted: Vec<f64>,
}

impl Ldlt {
    /// Analyzes a pattern; also returns where each of its places has gone in [`Ldlt::values`].
    pub fn new(pattern: &Pattern) -> Result<(Self, Vec<u32>), Error> {
        let n = pattern.starts.len() - 1;
        let order = minimum_degree(pattern)?;
        let mut new_of = vec![0u32; n];
        for (new, &old) in order.iter().enumerate() {
            new_of[old as usize] = new as u32;
        }

        let mut entries = Vec::with_capacity(pattern.rows.len());
        for column in 0..n {
            for &row in &pattern.rows[pattern.starts[column]..pattern.starts[column + 1]] {
                entries.push((new_of[row as usize], new_of[column]));
            }
        }
        let (starts, rows, places) = compress(n, &entries, |(a, b)| (a.max(b), a.min(b)));
        let (upper_starts, upper_rows, _) = compress(n, &entries, |(a, b)| (a.min(b), a.max(b)));
        let upper = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &upper_starts, None, &upper_rows);

        let request = StackReq::any_of(&[
            simplicial::prefactorize_symbolic_cholesky_scratch::<u32>(n, upper_rows.len()),
            supernodal::factorize_supernodal_symbolic_cholesky_scratch::<u32>(n),
        ]);
        let mut memory = MemBuffer::try_new(request).map_err(|_| Error::Memory)?;
        let mut tree = vec![0i32; n];
        let mut counts = vec![0u32; n];
        let tree = simplicial::prefactorize_symbolic_cholesky(
            &mut tree,
            &mut counts,
            upper,
            MemStack::new(&mut memory),
        );
        let symbolic = supernodal::factorize_supernodal_symbolic_cholesky(
            upper,
            tree,
            &counts,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .map_err(|_| Error::Memory)?;
        let request = StackReq::any_of(&[
            supernodal::factorize_supernodal_numeric_ldlt_scratch::<u32, f64>(
                &symbolic,
                Par::Seq,
                Spec::default(),
            ),
            symbolic.solve_in_place_scratch::<f64>(1, Par::Seq),
        ]);
        let ldlt = Self {
            order,
            starts,
            values: vec![0.0; rows.len()],
            rows,
            factors: vec![0.0; symbolic.len_val()],
            work: MemBuffer::try_new(request).map_err(|_| Error::Memory)?,
            permuted: vec![0.0; n],
            symbolic,
        };
        Ok((ldlt, places))
    }

    /// Entries of L, zeros in supernodes included.
    pub fn factor_len(&self) -> usize {
        self.factors.len()
    }

    /// Factors [`Ldlt::values`] and returns the number of negative pivots; `None` if a number is not finite.
    pub fn factor(&mut self) -> Option<usize> {
        let n = self.order.len();
        let pattern = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &self.starts, None, &self.rows);
        let regularization = LdltRegularization {
            dynamic_regularization_signs: None,
            dynamic_regularization_delta: LEAST_PIVOT,
            dynamic_regularization_epsilon: TINY_PIVOT,
        };
        supernodal::factorize_supernodal_numeric_ldlt(
            &mut self.factors,
            SparseColMatRef::new(pattern, &self.values),
            regularization,
            &self.symbolic,
            Par::Seq,
            MemStack::new(&mut self.work),
            Spec::default(),
        )
        .ok()?;
        let mut negative = 0;
        let starts = self.symbolic.col_ptr_for_val();
        let ends = self.symbolic.supernode_end();
        for (node, &begin) in self.symbolic.supernode_begin().iter().enumerate() {
            let width = (ends[node] - begin) as usize;
            let rows = width + self.symbolic.supernode(node).pattern().len();
            let panel = &self.factors[starts[node] as usize..starts[node + 1] as usize];
            for k in 0..width {
                let pivot = panel[k * (rows + 1)];
                if !pivot.is_finite() {
                    return None;
                }
                negative += usize::from(pivot < 0.0);
            }
        }
        Some(negative)
    }

    /// Solves with the last factors.
    pub fn solve(&mut self, x: &mut [f64]) {
        for (value, &old) in self.permuted.iter_mut().zip(&self.order) {
            *value = x[old as usize];
        }
        let n = x.len();
        supernodal::SupernodalLdltRef::new(&self.symbolic, &self.factors).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut self.permuted, n, 1),
            Par::Seq,
            MemStack::new(&mut self.work),
        );
        for (&value, &old) in self.permuted.iter().zip(&self.order) {
            x[old as usize] = value;
        }
    }
}

/// An order with little fill: new index to old.
fn minimum_degree(pattern: &Pattern) -> Result<Vec<u32>, Error> {
    let n = pattern.starts.len() - 1;
    let starts: Vec<u32> = pattern.starts.iter().map(|&start| start as u32).collect();
    let matrix = SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &pattern.rows);
    let request = amd::order_scratch::<u32>(n, pattern.rows.len());
    let mut memory = MemBuffer::try_new(request).map_err(|_| Error::Memory)?;
    let (mut order, mut inverse) = (vec![0u32; n], vec![0u32; n]);
    amd::order(&mut order, &mut inverse, matrix, amd::Control::default(), MemStack::new(&mut memory))
        .map_err(|_| Error::Memory)?;
    Ok(order)
}

/// Compressed columns: starts, rows, and the place of each entry. `orient` gives row and column.
fn compress(
    n: usize,
    entries: &[(u32, u32)],
    orient: impl Fn((u32, u32)) -> (u32, u32),
) -> (Vec<u32>, Vec<u32>, Vec<u32>) {
    let mut starts = vec![0u32; n + 1];
    for &entry in entries {
        starts[orient(entry).1 as usize + 1] += 1;
    }
    for column in 0..n {
        starts[column + 1] += starts[column];
    }
    let mut next = starts.clone();
    let (mut rows, mut places) = (vec![0; entries.len()], Vec::with_capacity(entries.len()));
    for &entry in entries {
        let (row, column) = orient(entry);
        let place = &mut next[column as usize];
        rows[*place as usize] = row;
        places.push(*place);
        *place += 1;
    }
    (starts, rows, places)
}
