// The picture of a mesh: triangle and depth at pixel centres, colour at every sample.

struct Camera {
    // Clip space from the mesh's frame. z is constant and w is the depth, so that z/w = near/depth:
    // the nearer, the larger, as precise far away as near by.
    clip_from_mesh: mat4x4<f32>,
    // Unit vector towards the light in the mesh's frame; w: brightness where light grazes.
    light: vec4<f32>,
    // Samples along each side of a pixel.
    per_pixel: u32,
}
@group(0) @binding(0) var<uniform> camera: Camera;

struct Corner {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec3<f32>,
}

struct Place {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) triangle: u32,
}

@vertex
fn place(corner: Corner, @builtin(vertex_index) index: u32) -> Place {
    return Place(camera.clip_from_mesh * vec4(corner.position, 1.0), index / 3u);
}

// Triangle and the bits of its depth: one integer target, which every driver draws.
@fragment
fn identify(place: Place) -> @location(0) vec2<u32> {
    return vec2(place.triangle, bitcast<u32>(1.0 / place.clip.w));
}

struct Lit {
    @builtin(position) clip: vec4<f32>,
    @location(0) color: vec3<f32>,
}

@vertex
fn light(corner: Corner) -> Lit {
    let cosine = abs(dot(corner.normal, camera.light.xyz));
    let brightness = camera.light.w + (1.0 - camera.light.w) * cosine;
    return Lit(camera.clip_from_mesh * vec4(corner.position, 1.0), corner.color * brightness);
}

@fragment
fn shade(lit: Lit) -> @location(0) vec4<f32> {
    return vec4(lit.color, 1.0);
}

@group(0) @binding(1) var samples: texture_2d<f32>;
@group(0) @binding(2) var between: sampler;

@vertex
fn cover(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2(f32(index & 1u), f32(index >> 1u));
    return vec4(corner * 4.0 - 1.0, 0.0, 1.0);
}

// The mean of a pixel's samples; of an even number, four at a time, read from where they meet.
@fragment
fn average(@builtin(position) place: vec4<f32>) -> @location(0) vec4<f32> {
    let per_pixel = camera.per_pixel;
    let first = vec2<u32>(place.xy) * per_pixel;
    let step = 2u - (per_pixel & 1u);
    let texel = 1.0 / vec2<f32>(textureDimensions(samples));
    var sum = vec4(0.0);
    for (var row = 0u; row < per_pixel; row += step) {
        for (var column = 0u; column < per_pixel; column += step) {
            let middle = vec2<f32>(first + vec2(column, row)) + 0.5 * f32(step);
            sum += textureSampleLevel(samples, between, middle * texel, 0.0);
        }
    }
    return sum * f32(step * step) / f32(per_pixel * per_pixel);
}
