//! Adam on one flat vector, with a state that can be saved.

use tch::{Device, Kind, Tensor};

use crate::checkpoint::Archive;
use crate::error::LearnError;
use crate::kernel::{self, ADAM, AdamStep};
use crate::net::{load_tensor, save_tensor};

/// Moments and count of steps. Decay rates 0.9 and 0.999, ε 1e-8 (PyTorch's defaults).
#[derive(Debug)]
pub(crate) struct Adam {
    first: Tensor,
    second: Tensor,
    n_steps: u64,
    learning_rate: f64,
}

impl Adam {
    pub(crate) fn new(n_values: i64, learning_rate: f64, options: (Kind, Device)) -> Self {
        Self {
            first: Tensor::zeros([n_values], options),
            second: Tensor::zeros([n_values], options),
            n_steps: 0,
            learning_rate,
        }
    }

    /// One step along `scale · gradient`.
    pub(crate) fn step(&mut self, parameters: &mut Tensor, gradient: &Tensor, scale: f64) {
        self.step_at(parameters, gradient, scale, 1.0);
    }

    /// The same with a share of the learning rate.
    pub(crate) fn step_at(
        &mut self,
        parameters: &mut Tensor,
        gradient: &Tensor,
        scale: f64,
        rate: f64,
    ) {
        self.n_steps += 1;
        let n = i32::try_from(self.n_steps).unwrap_or(i32::MAX);
        let step = AdamStep {
            rate: rate * self.learning_rate / (1.0 - ADAM.0.powi(n)),
            root_correction: (1.0 - ADAM.1.powi(n)).sqrt(),
            scale,
        };
        kernel::adam(
            parameters,
            gradient,
            (&mut self.first, &mut self.second),
            step,
        );
    }

    /// As new.
    pub(crate) fn reset(&mut self) {
        let _ = (self.first.zero_(), self.second.zero_());
        self.n_steps = 0;
    }

    pub(crate) fn save(&self, name: &str, archive: &mut Archive) {
        save_tensor(&self.first, &format!("{name}.adam.first"), archive);
        save_tensor(&self.second, &format!("{name}.adam.second"), archive);
        archive.put_json(&format!("{name}.adam.steps"), &self.n_steps);
    }

    pub(crate) fn load(&mut self, name: &str, archive: &Archive) -> Result<(), LearnError> {
        load_tensor(&mut self.first, &format!("{name}.adam.first"), archive)?;
        load_tensor(&mut self.second, &format!("{name}.adam.second"), archive)?;
        self.n_steps = archive.json(&format!("{name}.adam.steps"))?;
        Ok(())
    }
}
