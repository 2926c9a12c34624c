// Points, and the shading that shows their depth.

import {
  BufferAttribute, BufferGeometry, DepthTexture, Matrix4, Mesh, NearestFilter, OrthographicCamera, Points, Scene,
  ShaderMaterial, UnsignedIntType, WebGLRenderTarget,
} from "three";

// Discs that grow as the eye comes nearer: `distance` is where they have their size; from above it is how far the picture
// is enlarged. Colours are the display's own and pass unchanged.
export function pointMaterial() {
  return new ShaderMaterial({
    uniforms: { size: { value: 2 }, distance: { value: 1 } },
    vertexShader: `
      uniform float size;
      uniform float distance;
      attribute vec3 tone;
      varying vec3 shown;
      void main() {
        vec4 at = modelViewMatrix * vec4(position, 1.0);
        gl_Position = projectionMatrix * at;
        float away = isOrthographic ? 1.0 : max(-at.z, 1e-6);
        gl_PointSize = max(1.0, size * clamp(distance / away, 0.4, 12.0));
        shown = tone;
      }`,
    fragmentShader: `
      varying vec3 shown;
      void main() {
        vec2 at = 2.0 * gl_PointCoord - 1.0;
        if (dot(at, at) > 1.1) discard;
        gl_FragColor = vec4(shown, 1.0);
      }`,
  });
}

export function pointCloud(layer, arrays, tones, material, center) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(arrays.positions, 4));
  geometry.setAttribute("tone", new BufferAttribute(tones, 4, true));
  const cloud = new Points(geometry, material);
  const [x, y, z] = layer.origin.map((value, axis) => value - center[axis]);
  const { step } = layer;
  cloud.matrix = new Matrix4().set(step, 0, 0, x, 0, step, 0, y, 0, 0, step, z, 0, 0, 0, 1);
  cloud.matrixAutoUpdate = false;
  cloud.frustumCulled = false;
  return cloud;
}

// Eye-dome lighting (Boucheny 2009): a pixel is darkened by how far it lies behind its neighbours. It stands for normals,
// which clouds of leaves have none of.
export class DepthShading {
  constructor() {
    this.target = new WebGLRenderTarget(1, 1, { minFilter: NearestFilter, magFilter: NearestFilter });
    this.target.depthTexture = new DepthTexture(1, 1, UnsignedIntType);
    this.material = new ShaderMaterial({
      uniforms: {
        picture: { value: this.target.texture }, depths: { value: this.target.depthTexture },
        pixel: { value: [1, 1] }, near: { value: 0.1 }, far: { value: 10 }, strength: { value: 30 },
        flat_: { value: false }, lift: { value: 0 },
      },
      vertexShader: "varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",
      fragmentShader: `
        uniform sampler2D picture;
        uniform sampler2D depths;
        uniform vec2 pixel;
        uniform float near, far, strength, lift;
        uniform bool flat_;
        varying vec2 at;
        float logDepth(float depth) {
          if (flat_) return log2(max(near + depth * (far - near) - lift, 1e-3 * lift));
          return log2(near * far / (far - depth * (far - near)));
        }
        float behind(vec2 by, float own) {
          float depth = texture2D(depths, at + by * pixel).x;
          return depth >= 1.0 ? 0.0 : clamp(own - logDepth(depth), 0.0, 0.03);
        }
        void main() {
          float depth = texture2D(depths, at).x;
          if (depth >= 1.0) discard;
          float own = logDepth(depth);
          float sum = behind(vec2(1, 0), own) + behind(vec2(-1, 0), own) + behind(vec2(0, 1), own)
            + behind(vec2(0, -1), own);
          gl_FragColor = vec4(texture2D(picture, at).rgb * max(0.6, exp(-strength * 0.25 * sum)), 1.0);
          gl_FragDepth = depth;
        }`,
    });
    this.eye = new OrthographicCamera(-1, 1, 1, -1, 0, 1);
    const triangle = new BufferGeometry();
    triangle.setAttribute("position", new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
    triangle.setAttribute("uv", new BufferAttribute(new Float32Array([0, 0, 2, 0, 0, 2]), 2));
    const screen = new Mesh(triangle, this.material);
    screen.frustumCulled = false;
    this.scene = new Scene();
    this.scene.add(screen);
  }

  resize(width, height, ratio) {
    this.target.setSize(width, height);
    this.material.uniforms.pixel.value = [1.2 * ratio / width, 1.2 * ratio / height];
  }

  // `lift`: how much higher an orthographic camera stands than an eye that sees as much.
  render(renderer, clouds, camera, lift) {
    renderer.setRenderTarget(this.target);
    renderer.clear();
    renderer.render(clouds, camera);
    renderer.setRenderTarget(null);
    this.material.uniforms.flat_.value = camera.isOrthographicCamera === true;
    this.material.uniforms.lift.value = lift;
    this.material.uniforms.near.value = camera.near;
    this.material.uniforms.far.value = camera.far;
    renderer.render(this.scene, this.eye);
  }
}
