//! Taylor models of second order in Chebyshev's polynomials, several boxes side by side.
//!
//! On a box, with coordinates -1 <= `x_j` <= 1, a quantity f is
//!
//! ```text
//! |f(x) - c - sum_j c_j x_j - sum_j c_jj T2(x_j) - sum_{i<j} c_ij x_i x_j| <= remainder
//! ```
//!
//! with T2(x) = 2 x^2 - 1. A product's terms of third order are folded as far as they go, with
//! `x T2(x)` = (x + `T3(x)`)/2 and `x_i (x_i x_j)` = (`x_j` + `x_j T2(x_i)`)/2. Their rest goes into the remainder, but
//! only when a sum of products is complete: until then the terms of each kind are added up, and may cancel. The terms of
//! fourth order and all rounding go into the remainder at once.

use super::products::{ModelLayout, ZERO, add_product, add_scaled, measure, thirds};
use super::rounding::{SIN_COS_ERROR, UNDERFLOW, UNIT, UP, Waves};

pub(super) use super::products::{COEFFICIENTS, LANES, Lanes, VARIABLES, linear, second};

/// One model of a [`ModelWorkspace`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TaylorModel {
    index: usize,
    /// The variables that it depends on: first..last.
    first: usize,
    last: usize,
    /// Whether its part of second order is nought, as it was made.
    is_linear: bool,
}

impl TaylorModel {
    /// Nought.
    pub const ZERO: Self = Self {
        index: 0,
        first: 0,
        last: 0,
        is_linear: true,
    };
}

/// Three models.
pub(super) type ModelVector = [TaylorModel; 3];

/// Room for the models of one evaluation.
#[derive(Debug, Clone)]
pub(super) struct ModelWorkspace {
    layout: ModelLayout,
    numbers: Vec<Lanes>,
    used: usize,
    /// The third order of the sum that is being made, and whether there is any.
    third: Vec<Lanes>,
    has_third: bool,
}

impl ModelWorkspace {
    /// Room for models of so many variables.
    pub fn new(variables: usize) -> Self {
        let layout = ModelLayout { variables };
        Self {
            layout,
            numbers: vec![ZERO; layout.length()],
            used: 1,
            third: vec![ZERO; thirds(variables)],
            has_third: false,
        }
    }

    /// Forgets all models.
    pub fn clear(&mut self) {
        self.used = 1;
    }

    /// The numbers of a model, coefficients first.
    pub fn coefficients(&self, model: TaylorModel) -> &[Lanes] {
        &self.all(model)[..self.layout.remainder()]
    }

    /// A model's remainder.
    pub fn remainder(&self, model: TaylorModel) -> &Lanes {
        &self.all(model)[self.layout.remainder()]
    }

    /// A model's polynomial, exactly.
    pub fn polynomial_of(&mut self, model: TaylorModel) -> TaylorModel {
        if model == TaylorModel::ZERO {
            return model;
        }
        let layout = self.layout;
        let (known, top) = self.begin();
        let numbers = &known[model.index * layout.length()..][..layout.remainder()];
        top[..layout.remainder()].copy_from_slice(numbers);
        self.push(model.first, model.last)
    }

    /// A bound of a model's part of second order.
    pub fn bend(&self, model: TaylorModel) -> &Lanes {
        &self.all(model)[self.layout.sizes() + 2]
    }

    /// Takes a model for exactly its polynomial.
    #[cfg(test)]
    pub fn forget_remainder(&mut self, model: TaylorModel) {
        let place = model.index * self.layout.length() + self.layout.remainder();
        self.numbers[place] = ZERO;
    }

    /// Bounds of |f|.
    pub fn bound(&self, model: TaylorModel) -> Lanes {
        let numbers = self.all(model);
        let sizes = &numbers[self.layout.sizes()..][..3];
        let remainder = &numbers[self.layout.remainder()];
        std::array::from_fn(|lane| {
            (sizes[0][lane] + sizes[1][lane] + sizes[2][lane] + remainder[lane]) * UP
        })
    }

    /// By how much a model changes with one of its variables, roughly.
    pub fn add_spread(&self, model: TaylorModel, spread: &mut [Lanes; VARIABLES]) {
        let numbers = self.all(model);
        let second = &numbers[self.layout.sizes() + 2];
        for variable in model.first..model.last {
            let slope = &numbers[linear(variable)];
            let unfolded = &numbers[self.layout.unfolded() + variable];
            for lane in 0..LANES {
                spread[variable][lane] += slope[lane].abs() + 2.0 * (second[lane] - unfolded[lane]);
            }
        }
    }

    /// A constant that is known to within an error.
    pub fn constant(&mut self, value: f64, error: f64) -> TaylorModel {
        if value == 0.0 && error == 0.0 {
            return TaylorModel::ZERO;
        }
        self.constants(&[value; LANES], &[error; LANES])
    }

    /// A constant of its own in each lane.
    pub fn constants(&mut self, values: &Lanes, errors: &Lanes) -> TaylorModel {
        let layout = self.layout;
        let (_, top) = self.begin();
        top[0] = *values;
        top[layout.remainder()] = *errors;
        self.push(0, 0)
    }

    /// A coordinate of the box: exactly centre + half-width times `x_j`.
    pub fn variable(&mut self, j: usize, centre: &Lanes, half_width: &Lanes) -> TaylorModel {
        let (_, top) = self.begin();
        top[0] = *centre;
        top[linear(j)] = *half_width;
        self.push(j, j + 1)
    }

    /// A linear function of the coordinates `x_j`: exactly this constant and these slopes.
    pub fn linear_form(&mut self, constant: &Lanes, slopes: &[Lanes]) -> TaylorModel {
        let (_, top) = self.begin();
        top[0] = *constant;
        for (j, slope) in slopes.iter().enumerate() {
            top[linear(j)] = *slope;
        }
        TaylorModel {
            is_linear: true,
            ..self.push(0, slopes.len())
        }
    }

    /// Sine and cosine of a coordinate of the box, from those of its centre and the waves of its
    /// half-width.
    pub fn sin_cos(
        &mut self,
        j: usize,
        centre: &[(f64, f64); LANES],
        waves: &[Waves; LANES],
    ) -> [TaylorModel; 2] {
        // All factors are within 1 but for 1e-15: sine and cosine of the centre come in with three
        // coefficients, and each of these products is rounded once.
        const ROUNDING: f64 = 4.0 * SIN_COS_ERROR + 8.0 * UNIT;
        [false, true].map(|is_cosine| {
            let layout = self.layout;
            let (_, top) = self.begin();
            for lane in 0..LANES {
                let (sine, cosine) = centre[lane];
                // sin(a + t) = sin a cos t + cos a sin t, cos(a + t) = cos a cos t - sin a sin t.
                let (even, odd) = if is_cosine {
                    (cosine, -sine)
                } else {
                    (sine, cosine)
                };
                let waves = &waves[lane];
                top[0][lane] = even * waves.cosine[0];
                top[linear(j)][lane] = odd * waves.sine;
                top[second(j, j)][lane] = even * waves.cosine[1];
                top[layout.remainder()][lane] =
                    (even.abs() * waves.cosine_error + odd.abs() * waves.sine_error + ROUNDING)
                        * UP;
            }
            self.push(j, j + 1)
        })
    }

    /// The product of two models.
    pub fn times(&mut self, one: TaylorModel, other: TaylorModel) -> TaylorModel {
        self.sum().product(1.0, one, other).end()
    }

    /// A vector, each part times a model.
    pub fn scaled(&mut self, vector: &ModelVector, by: TaylorModel) -> ModelVector {
        vector.map(|part| self.times(part, by))
    }

    /// A model times a constant whose relative error is one rounding.
    pub fn times_rounded(&mut self, factor: f64, model: TaylorModel) -> TaylorModel {
        let error = UNIT * factor.abs();
        self.sum().add_constant(factor, error, model).end()
    }

    /// Begins a sum of products.
    pub fn sum(&mut self) -> ModelSum<'_> {
        self.begin();
        if self.has_third {
            self.third.fill(ZERO);
            self.has_third = false;
        }
        ModelSum {
            workspace: self,
            first: 0,
            last: 0,
            roundings: 0,
        }
    }

    fn all(&self, model: TaylorModel) -> &[Lanes] {
        let length = self.layout.length();
        &self.numbers[model.index * length..][..length]
    }

    /// The models there are, and room for the next, all noughts.
    fn begin(&mut self) -> (&[Lanes], &mut [Lanes]) {
        let length = self.layout.length();
        let start = self.used * length;
        if self.numbers.len() < start + length {
            self.numbers.resize(start + length, ZERO);
        }
        self.numbers[start..start + length].fill(ZERO);
        self.top()
    }

    fn top(&mut self) -> (&[Lanes], &mut [Lanes]) {
        let length = self.layout.length();
        let (known, rest) = self.numbers.split_at_mut(self.used * length);
        (known, &mut rest[..length])
    }

    /// The same with the third order of the sum that is being made, to be added to.
    fn top_and_third(&mut self) -> (&[Lanes], &mut [Lanes], &mut [Lanes]) {
        let length = self.layout.length();
        let (known, rest) = self.numbers.split_at_mut(self.used * length);
        (known, &mut rest[..length], &mut self.third)
    }

    /// Keeps the model that was begun.
    fn push(&mut self, first: usize, last: usize) -> TaylorModel {
        let layout = self.layout;
        let (_, top) = self.top();
        measure(layout, top, [first, last]);
        self.used += 1;
        TaylorModel {
            index: self.used - 1,
            first,
            last,
            is_linear: first == last,
        }
    }
}

/// A sum of products of models, which is rounded as a whole.
pub(super) struct ModelSum<'a> {
    workspace: &'a mut ModelWorkspace,
    first: usize,
    last: usize,
    /// The number of roundings on the way of any one term into the sum, at most.
    roundings: u32,
}

impl ModelSum<'_> {
    /// Adds so many times a model.
    pub fn add(self, factor: f64, model: TaylorModel) -> Self {
        self.add_constant(factor, 0.0, model)
    }

    /// Adds a model times a constant that is known to within an error.
    pub fn add_constant(self, factor: f64, error: f64, model: TaylorModel) -> Self {
        if factor == 0.0 && error == 0.0 {
            return self;
        }
        self.add_lanes(&[factor; LANES], error, model)
    }

    /// Adds a model times a constant of its own in each lane, known to within an error.
    pub fn add_lanes(mut self, factor: &Lanes, error: f64, model: TaylorModel) -> Self {
        if model == TaylorModel::ZERO {
            return self;
        }
        self.widen(model);
        self.roundings += 3;
        let layout = self.workspace.layout;
        let (known, top) = self.workspace.top();
        let model_numbers = &known[model.index * layout.length()..][..layout.length()];
        add_scaled(layout, top, (factor, error), model_numbers, range(model));
        self
    }

    /// Adds the product of two models, times 1 or -1.
    pub fn product(mut self, sign: f64, one: TaylorModel, other: TaylorModel) -> Self {
        if one == TaylorModel::ZERO || other == TaylorModel::ZERO {
            return self;
        }
        self.widen(one);
        self.widen(other);
        // Two products of constants with each part, up to 8 terms of each kind and order of the others.
        self.roundings += 24;
        self.workspace.has_third = true;
        let layout = self.workspace.layout;
        let (known, top, third) = self.workspace.top_and_third();
        let numbers =
            |model: TaylorModel| &known[model.index * layout.length()..][..layout.length()];
        add_product(
            layout,
            (top, third),
            sign,
            (numbers(one), range(one)),
            (numbers(other), range(other)),
            [one == other, other.is_linear],
        );
        self
    }

    /// Adds the square of a model.
    pub fn square(self, model: TaylorModel) -> Self {
        self.product(1.0, model, model)
    }

    /// The sum as a model.
    pub fn end(self) -> TaylorModel {
        if self.roundings == 0 {
            return TaylorModel::ZERO;
        }
        let layout = self.workspace.layout;
        let used = if self.workspace.has_third {
            thirds(self.last)
        } else {
            0
        };
        let (_, top, third) = self.workspace.top_and_third();
        let mut left = ZERO;
        for terms in &third[..used] {
            for lane in 0..LANES {
                left[lane] += terms[lane].abs();
            }
        }
        // (1 + UNIT)^k - 1 <= k UNIT times less than 1 + 1e-10, which the slack of 8 covers.
        let relative = UNIT * f64::from(self.roundings + 8);
        let magnitude = top[layout.magnitude()];
        let remainders = &mut top[layout.remainder()];
        for lane in 0..LANES {
            let lost = magnitude[lane] * relative + UNDERFLOW;
            remainders[lane] = (remainders[lane] + left[lane] * UP + lost) * UP;
        }
        self.workspace.push(self.first, self.last)
    }

    fn widen(&mut self, model: TaylorModel) {
        if self.first == self.last {
            (self.first, self.last) = (model.first, model.last);
        } else if model.first < model.last {
            self.first = self.first.min(model.first);
            self.last = self.last.max(model.last);
        }
    }
}

const fn range(model: TaylorModel) -> [usize; 2] {
    [model.first, model.last]
}
