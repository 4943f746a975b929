//! The graphics driver: found, opened, and listened to.

use std::sync::{Arc, Mutex};

use crate::{Error, Result};

/// An open driver. What goes wrong inside it is kept until somebody asks with [`Device::check`];
/// left alone, the library would panic.
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
    pub fn open() -> Result<Self> {
        // GL is asked last: its loader talks to the terminal where there is no display.
        let adapter = adapter(wgpu::Backends::PRIMARY)
            .or_else(|_| adapter(wgpu::Backends::GL))
            .map_err(|error| Error::NoGpu { reason: error.to_string() })?;
        let limits = wgpu::Limits::downlevel_webgl2_defaults().using_resolution(adapter.limits());
        let limits = wgpu::Limits { max_buffer_size: adapter.limits().max_buffer_size, ..limits };
        let description = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&description))
            .map_err(|error| Error::Gpu { reason: error.to_string() })?;
        let fault = Arc::new(Mutex::new(None));
        let heard = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error| note(&heard, error.to_string())));
        let heard = fault.clone();
        device.set_device_lost_callback(move |reason, message| {
            // Dropping a device is reported as a loss, too.
            if reason != wgpu::DeviceLostReason::Destroyed {
                note(&heard, format!("the device was lost: {message}"));
            }
        });
        Ok(Self { device, queue, adapter: adapter.get_info(), fault })
    }

    /// The first thing that went wrong since the last question.
    ///
    /// # Errors
    /// [`Error::Gpu`].
    pub fn check(&self) -> Result<()> {
        let fault = self.fault.lock().ok().and_then(|mut fault| fault.take());
        fault.map_or(Ok(()), |reason| Err(Error::Gpu { reason }))
    }

    /// Waits until everything that was sent has been done.
    pub fn wait(&self) -> Result<()> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        waited.map(drop).map_err(|error| Error::Gpu { reason: error.to_string() })
    }
}

/// The fastest adapter behind some interfaces.
fn adapter(
    backends: wgpu::Backends,
) -> std::result::Result<wgpu::Adapter, wgpu::RequestAdapterError> {
    let description = wgpu::InstanceDescriptor {
        backends,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    };
    let wanted = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    };
    pollster::block_on(wgpu::Instance::new(description).request_adapter(&wanted))
}

/// Keeps the first fault: those that follow are its echo.
fn note(fault: &Mutex<Option<String>>, reason: String) {
    if let Ok(mut fault) = fault.lock() {
        fault.get_or_insert(reason);
    }
}
