//! What work costs: time on the wall, and time of all cores together.

use std::ops::AddAssign;
use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};

/// Time that something took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spent {
    /// Seconds on the wall: what a user waits, on an idle machine.
    pub wall: f64,
    /// Seconds of all cores together: what it costs, whatever else the machine does meanwhile.
    pub cpu: f64,
}

impl AddAssign for Spent {
    fn add_assign(&mut self, o: Self) {
        self.wall += o.wall;
        self.cpu += o.cpu;
    }
}

/// Measures [`Spent`] from its start.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    wall: Instant,
    cpu: Duration,
}

impl Spent {
    /// Seconds of all cores as a duration.
    pub fn cpu_duration(self) -> Duration {
        Duration::from_secs_f64(self.cpu)
    }

    /// Seconds on the wall as a duration.
    pub fn wall_duration(self) -> Duration {
        Duration::from_secs_f64(self.wall)
    }
}

impl Stopwatch {
    /// Starts measuring.
    pub fn start() -> Self {
        Stopwatch { wall: Instant::now(), cpu: cpu_time() }
    }

    /// Time since the start.
    pub fn spent(&self) -> Spent {
        let cpu = cpu_time().saturating_sub(self.cpu);
        Spent { wall: self.wall.elapsed().as_secs_f64(), cpu: cpu.as_secs_f64() }
    }
}

/// Time that all threads of this process have used.
fn cpu_time() -> Duration {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    // The clock starts at 0 with the process and never runs backwards.
    Duration::new(now.tv_sec.unsigned_abs(), now.tv_nsec.unsigned_abs() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_costs_cores_and_sleep_does_not() {
        let watch = Stopwatch::start();
        let mut x = 1u32;
        while watch.spent().cpu < 0.02 {
            x = std::hint::black_box(x.wrapping_mul(3));
        }
        assert!(watch.spent().wall > 0.0);
        let before = watch.spent();
        std::thread::sleep(Duration::from_millis(50));
        assert!(watch.spent().wall - before.wall >= 0.05);
    }
}
