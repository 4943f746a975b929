//! The graphics driver: found, opened, and its failures kept.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::{Error, Result};

/// A driver that has not finished a batch after this long hangs: lavapipe fills the largest there
/// are in a tenth of it.
const DRIVER_TIMEOUT: Duration = Duration::from_secs(120);

/// Less than what the driver has, so that tests meet its limits.
pub(super) struct DriverLimits {
    pub texture_side: u32,
    pub buffer_bytes: u64,
    /// Share of the driver's memory beyond which it says that there is none left.
    pub memory_percent: u8,
}

impl Default for DriverLimits {
    fn default() -> Self {
        Self { texture_side: u32::MAX, buffer_bytes: u64::MAX, memory_percent: 95 }
    }
}

/// An open driver. What goes wrong inside it is kept until [`Device::check`] reports it; without
/// that the library would panic.
pub(super) struct Device {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub adapter: wgpu::AdapterInfo,
    fault: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// Opens the fastest adapter there is.
    ///
    /// # Errors
    /// [`Error::NoGpu`] without a driver, [`Error::Gpu`] where it does not open.
    pub fn open(limits: &DriverLimits) -> Result<Self> {
        let adapter =
            adapter(limits).map_err(|reason| Error::NoGpu { reason: reason.to_string() })?;
        let own = adapter.limits();
        let mut required = wgpu::Limits::downlevel_webgl2_defaults().using_resolution(own.clone());
        required.max_texture_dimension_2d =
            required.max_texture_dimension_2d.min(limits.texture_side);
        required.max_buffer_size = own.max_buffer_size.min(limits.buffer_bytes);
        let description =
            wgpu::DeviceDescriptor { required_limits: required, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&description))
            .map_err(|error| Error::Gpu { reason: error.to_string() })?;
        let fault = Arc::new(Mutex::new(None));
        let kept = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error| note(&kept, error.to_string())));
        let kept = fault.clone();
        device.set_device_lost_callback(move |_, message| {
            note(&kept, format!("the device was lost: {message}"));
        });
        Ok(Self { device, queue, adapter: adapter.get_info(), fault })
    }

    /// The first thing that went wrong since the last check.
    ///
    /// # Errors
    /// [`Error::Gpu`].
    pub fn check(&self) -> Result<()> {
        let fault = self.fault.lock().ok().and_then(|mut fault| fault.take());
        fault.map_or(Ok(()), |reason| Err(Error::Gpu { reason }))
    }

    /// A buffer filled with `bytes`, whose number is a multiple of four.
    ///
    /// # Errors
    /// [`Error::Gpu`] where the driver has no memory for it, or is lost.
    pub fn buffer(&self, bytes: &[u8], usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.len() as u64,
            usage,
            mapped_at_creation: true,
        });
        let mapped = buffer.slice(..).get_mapped_range_mut();
        self.check()?; // knows more of the reason
        mapped.map_err(|error| Error::Gpu { reason: error.to_string() })?.copy_from_slice(bytes);
        buffer.unmap();
        Ok(buffer)
    }

    /// Waits until a submission has been done.
    ///
    /// # Errors
    /// [`Error::Gpu`] for what went wrong until then, and for a driver that hangs.
    pub fn wait(&self, submission: &wgpu::SubmissionIndex) -> Result<()> {
        let poll = wgpu::PollType::Wait {
            submission_index: Some(submission.clone()),
            timeout: Some(DRIVER_TIMEOUT),
        };
        // The library panics where the driver is lost in this very moment.
        let waited = catch_unwind(AssertUnwindSafe(|| self.device.poll(poll)));
        self.check()?;
        let reason = match waited {
            Ok(Ok(_)) => return Ok(()),
            Ok(Err(error)) => error.to_string(),
            Err(_) => "the device was lost".to_owned(),
        };
        Err(Error::Gpu { reason })
    }
}

impl Drop for Device {
    /// Waits for what was submitted and closes the device, so that no thread of the driver is at work
    /// when the process ends.
    fn drop(&mut self) {
        let poll = wgpu::PollType::Wait { submission_index: None, timeout: Some(DRIVER_TIMEOUT) };
        // A driver that is lost has nothing to wait for, and the library panics.
        let _ = catch_unwind(AssertUnwindSafe(|| self.device.poll(poll)));
        self.device.destroy();
    }
}

/// The fastest adapter there is.
fn adapter(limits: &DriverLimits) -> std::result::Result<wgpu::Adapter, wgpu::RequestAdapterError> {
    let description = wgpu::InstanceDescriptor {
        backends: wgpu::Backends::PRIMARY,
        memory_budget_thresholds: wgpu::MemoryBudgetThresholds {
            for_resource_creation: Some(limits.memory_percent),
            for_device_loss: None,
        },
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    };
    let wanted = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    };
    pollster::block_on(wgpu::Instance::new(description).request_adapter(&wanted))
}

/// Keeps the first fault: those that follow are its consequences.
fn note(fault: &Mutex<Option<String>>, reason: String) {
    if let Ok(mut fault) = fault.lock() {
        fault.get_or_insert(reason);
    }
}
