// SPDX-License-Identifier: GPL-3.0-or-later
// The scene in 3D: bodies, contacts, arrows. Metres, Z up, all in the world frame.
import * as THREE from "three";
import { OrbitControls } from "orbit";
import { css } from "./plot_style.js";

const colour = (name) => new THREE.Color(css(name));

/** Sets the pose of an object: x y z [m], qx qy qz qw. */
function place(object, pose) {
  object.position.set(pose[0], pose[1], pose[2]);
  object.quaternion.set(pose[3], pose[4], pose[5], pose[6]);
}

/** Offset for coplanar faces: faces with a lower number are drawn in front, edges in front of all faces. */
const behind = (steps) => ({ polygonOffset: true, polygonOffsetFactor: steps, polygonOffsetUnits: steps });

/** Returns the largest 1, 2 or 5 times a power of ten that does not exceed x. */
function round125(x) {
  const decade = 10 ** Math.floor(Math.log10(x));
  return decade * (x / decade >= 5 ? 5 : x / decade >= 2 ? 2 : 1);
}

/**
 * A machine counts as slow if the mean frame time exceeds SLOW_MS. The mean is necessary because the graphics processor
 * draws asynchronously. The scene counts as static if nothing has moved for AT_REST_MS.
 */
const SLOW_MS = 60, OVER_FRAMES = 8, AT_REST_MS = 400;
const ARROW_RADII_PER_N = 2 / 3;  // length of the force arrow, in radii of the tool
const MOST_MS = 150;  // clamps the first frames, which compile shaders

const UP = new THREE.Vector3(0, 1, 0);

/**
 * Directions from the scene to the camera, in the world. "top" is tilted toward -x, because a camera exactly above has no upward
 * direction; +x is then up on the screen.
 */
const VIEWPOINTS = { top: [-1e-4, 0, 1], front: [-1, 0, 0], side: [0, -1, 0] };

const INSIDE = 0.96;  // of the half width and half height of the picture

/** Returns the share of a line that is inside the picture, from its start; 1 if its start is outside. */
function shareInside(from, along, camera) {
  const inside = (share, border) => {
    const at = from.clone().addScaledVector(along, share).project(camera);
    return Math.abs(at.x) <= border && Math.abs(at.y) <= border && at.z < 1;
  };
  const border = inside(0, INSIDE) ? INSIDE : 1;
  if (inside(1, border) || !inside(0, border)) return 1;
  let low = 0, high = 1;
  for (let i = 0; i < 20; ++i) {
    const middle = (low + high) / 2;
    if (inside(middle, border)) low = middle;
    else high = middle;
  }
  return low;
}

/** An arrow of any length and thickness, along +Y before its rotation. */
class Arrow extends THREE.Group {
  constructor(material) {
    super();
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(1, 1, 1, 20).translate(0, 0.5, 0), material);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(1, 1, 24).translate(0, 0.5, 0), material);
    this.second = new THREE.Mesh(this.head.geometry, material);
    this.second.visible = false;
    this.add(this.shaft, this.head, this.second);
    this.renderOrder = 3;
  }

  /** Sets the arrow without the borders of the picture; fitInto() then draws it. */
  aim(from, along, thickness) {
    this.aimed = { from: from.clone(), along, thickness };
    this.point(from, along, thickness);
  }

  hide() {
    this.aimed = undefined;
    this.visible = false;
  }

  /** Shortens the arrow so that it ends inside the picture, but not below its thickness; a shortened arrow has a second head. */
  fitInto(camera) {
    if (!this.aimed) return;
    const { from, along, thickness } = this.aimed;
    const share = shareInside(from, along, camera);
    const length = Math.max(share * along.length(), Math.min(along.length(), 2 * thickness));
    this.point(from, along.clone().setLength(length), thickness);
    this.second.visible = share < 1;
  }

  /** from, along: Vector3; the length of `along` is the arrow's length [m]. */
  point(from, along, thickness) {
    const length = along.length();
    this.visible = length > 1.5 * thickness;
    if (!this.visible) return;
    const head = Math.min(5 * thickness, 0.6 * length);
    this.position.copy(from);
    this.quaternion.setFromUnitVectors(UP, along.clone().divideScalar(length));
    this.shaft.scale.set(thickness, length - head, thickness);
    this.head.position.y = length - head;
    this.head.scale.set(0.45 * head, head, 0.45 * head);
    this.second.position.y = length - 2 * head;
    this.second.scale.copy(this.head.scale);
  }
}

/** An arc of 270 degrees about an axis with an arrow head, which shows a torque. */
class Turn extends THREE.Group {
  constructor(material) {
    super();
    const arc = 1.5 * Math.PI;
    this.ring = new THREE.Mesh(new THREE.TorusGeometry(1, 0.05, 10, 48, arc), material);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(0.16, 0.42, 20), material);
    this.head.position.set(0, -1, 0);  // at the end of the arc, pointing along +X
    this.head.rotation.z = -Math.PI / 2;
    this.add(this.ring, this.head);
  }

  about(at, axis, radius) {
    this.visible = radius > 0;
    if (!this.visible) return;
    this.position.copy(at);
    this.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), axis);
    this.scale.setScalar(radius);
  }
}

export class World {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.001, 100);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => (this.changed = true));
    this.controls.addEventListener("start", () => (this.touched = true));
    this.controls.listenToKeyEvents?.(canvas);
    this.light();
    this.materials = {
      tool: new THREE.MeshLambertMaterial(behind(1)),
      ghost: new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.3, depthWrite: false, ...behind(3) }),
      obstacle: new THREE.MeshLambertMaterial({ side: THREE.DoubleSide, ...behind(1) }),
      moving: new THREE.MeshLambertMaterial({ side: THREE.DoubleSide, ...behind(1) }),
      plane: new THREE.MeshLambertMaterial({ side: THREE.DoubleSide, transparent: true, opacity: 0.55, depthWrite: false, ...behind(2) }),
      edge: new THREE.LineBasicMaterial({ transparent: true, opacity: 0.55 }),
      ghostEdge: new THREE.LineBasicMaterial({ transparent: true, opacity: 0.6 }),
      grid: new THREE.LineBasicMaterial({ transparent: true, opacity: 0.3 }),
      second: new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.35, depthWrite: false, ...behind(3) }),
      secondEdge: new THREE.LineBasicMaterial({ transparent: true, opacity: 0.7 }),
      contact: new THREE.MeshBasicMaterial({ depthTest: false, transparent: true }),
      force: new THREE.MeshBasicMaterial({ depthTest: false, transparent: true, opacity: 0.92 }),
      torque: new THREE.MeshBasicMaterial({ depthTest: false, transparent: true, opacity: 0.92 }),
    };
    this.bodies = new THREE.Group();
    this.marks = new THREE.Group();
    this.scene.add(this.bodies, this.marks);
    this.force = new Arrow(this.materials.force);
    this.torque = new Turn(this.materials.torque);
    this.force.visible = this.torque.visible = false;
    this.scene.add(this.force, this.torque);
    this.meshes = new Map();
    this.contacts = [];
    this.obstacles = [];
    this.size = 0.05;
    this.showGhost = true;
    this.recolour();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
  }

  light() {
    this.sky = new THREE.HemisphereLight(0xffffff, 0x8a94a3, 2.1);
    this.sky.position.set(0, 0, 1);
    const key = new THREE.DirectionalLight(0xffffff, 1.7);
    key.position.set(-0.5, 0.6, 1);
    const fill = new THREE.DirectionalLight(0xffffff, 0.5);
    fill.position.set(0.8, -0.7, 0.3);
    this.scene.add(this.sky, key, fill);
  }

  recolour() {
    const set = (name, variable) => this.materials[name].color.copy(colour(variable));
    set("tool", "--tool");
    set("ghost", "--ghost");
    set("obstacle", "--obstacle");
    set("moving", "--moving");
    set("plane", "--obstacle");
    set("edge", "--edge");
    set("ghostEdge", "--ghost");
    set("grid", "--edge");
    set("second", "--second");
    set("secondEdge", "--second");
    set("contact", "--contact");
    set("force", "--force");
    set("torque", "--torque");
    this.changed = true;
  }

  /** Stores a mesh of the scene message that follows. */
  mesh({ number, simplified, positions, normals, triangles, lines }) {
    if (number === 0 && !simplified) this.meshes.clear();
    const surface = new THREE.BufferGeometry();
    surface.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    surface.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
    surface.setIndex(new THREE.BufferAttribute(triangles, 1));
    surface.computeBoundingSphere();
    const edges = new THREE.BufferGeometry();
    edges.setAttribute("position", new THREE.BufferAttribute(lines, 3));
    if (simplified) this.meshes.get(number).simplified = { surface, edges };
    else this.meshes.set(number, { surface, edges });
  }

  /** Selects the simplified meshes, where available. */
  drawSimplified(simplified) {
    if (simplified === this.simplified) return;
    this.simplified = simplified;
    for (const body of this.bodies.children) {
      const mesh = this.meshes.get(body.userData.mesh);
      if (!mesh?.simplified) continue;
      const { surface, edges } = simplified ? mesh.simplified : mesh;
      body.children[0].geometry = surface;
      body.children[1].geometry = edges;
    }
  }

  /** Returns the number of triangles of all meshes, each counted once, at the present level of detail. */
  triangles() {
    let all = 0;
    for (const mesh of this.meshes.values()) all += ((this.simplified && mesh.simplified) || mesh).surface.index.count / 3;
    return all;
  }

  body(number, material, edge) {
    const { surface, edges } = this.meshes.get(number);
    const body = new THREE.Group();
    body.add(new THREE.Mesh(surface, material), new THREE.LineSegments(edges, edge));
    body.userData.mesh = number;
    return body;
  }

  /** Builds tool and obstacles from their meshes. */
  show({ tool, obstacles, view }) {
    const elsewhere = JSON.stringify(view) !== JSON.stringify(this.view);
    this.view = view;
    this.simplified = false;
    this.sceneCount = (this.sceneCount ?? 0) + 1;
    this.bodies.clear();
    const radius = this.meshes.get(tool.mesh).surface.boundingSphere.radius;
    this.size = radius;
    this.tool = this.body(tool.mesh, this.materials.tool, this.materials.edge);
    this.ghost = this.body(tool.mesh, this.materials.ghost, this.materials.ghostEdge);
    this.ghost.renderOrder = 2;
    this.second = this.body(tool.mesh, this.materials.second, this.materials.secondEdge);  // of the compared recording
    this.second.renderOrder = 2;
    this.tool.visible = this.ghost.visible = this.second.visible = false;
    this.bodies.add(this.tool, this.ghost, this.second);
    this.obstacles = obstacles.map((one) => {
      const body = one.half_space ? this.plane(one.half_space) : this.body(one.mesh, one.moves ? this.materials.moving : this.materials.obstacle, this.materials.edge);
      if (one.pose) place(body, one.pose);
      this.bodies.add(body);
      return body;
    });
    // Keeps a camera that the user has moved when the scene changes.
    if (elsewhere || !this.touched) this.fitted = false;
    this.changed = true;
  }

  /** Returns a patch of the surface of a half-space with a grid as a scale. */
  plane({ normal, offset_m }) {
    const size = Math.max(6 * this.size, 0.1), step = round125(size / 8);
    const half = Math.ceil(size / step) * step;
    const body = new THREE.Group();
    body.add(new THREE.Mesh(new THREE.PlaneGeometry(2 * half, 2 * half), this.materials.plane));
    const points = [];
    for (let x = -half; x <= half + step / 2; x += step) points.push(x, -half, 0, x, half, 0, -half, x, 0, half, x, 0);
    const grid = new THREE.BufferGeometry();
    grid.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    body.add(new THREE.LineSegments(grid, this.materials.grid));
    const n = new THREE.Vector3(...normal);
    body.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), n);
    body.position.copy(n.multiplyScalar(offset_m));
    return body;
  }

  /** Shows one frame. */
  take(frame) {
    this.changed = true;
    if (this.tool) {
      this.ghost.visible = this.showGhost;
      place(this.ghost, frame.p);
      if (this.followed) this.followTool();
      this.tool.visible = frame.q !== null;
      if (frame.q !== null) place(this.tool, frame.q);
      this.second.visible = Boolean(frame.compared);
      if (frame.compared) place(this.second, frame.compared.q ?? frame.compared.p);
    }
    for (const [number, pose] of frame.moved) if (this.obstacles[number]) place(this.obstacles[number], pose);
    this.showContacts(frame.contacts);
    this.push(frame.wrench);
    if (!this.fitted && this.tool) this.fit(frame.p);
  }

  showContacts(contacts) {
    while (this.contacts.length < contacts.length) {
      const point = new THREE.Mesh(new THREE.SphereGeometry(1, 20, 14), this.materials.contact);
      const normal = new Arrow(this.materials.contact);
      point.renderOrder = normal.renderOrder = 3;
      this.marks.add(point, normal);
      this.contacts.push({ point, normal });
    }
    this.contacts.forEach(({ point, normal }, i) => {
      point.visible = i < contacts.length;
      if (!point.visible) return normal.hide();
      const { p, n, load_fraction, force_N } = contacts[i];
      point.position.set(...p);
      point.scale.setScalar(this.size * (0.025 + 0.035 * Math.sqrt(load_fraction ?? 0)));
      // Also a contact without force shows its normal.
      const length = Math.max(0.15, ARROW_RADII_PER_N * (force_N ?? 0)) * this.size;
      normal.aim(point.position, new THREE.Vector3(...n).multiplyScalar(length), 0.014 * this.size);
    });
  }

  /** Draws the wrench: the arrow of 3 N has twice the tool radius; the arc of 0.1 N.m has about the tool radius. */
  push({ at, force, torque }) {
    const from = new THREE.Vector3(...at), f = new THREE.Vector3(...force), m = new THREE.Vector3(...torque);
    this.force.aim(from, f.multiplyScalar(ARROW_RADII_PER_N * this.size), 0.03 * this.size);
    const strength = m.length();
    const radius = strength < 1e-3 ? 0 : this.size * Math.min(0.25 + strength / 0.1, 1.5);
    this.torque.about(from, strength > 0 ? m.divideScalar(strength) : UP, radius);
  }

  /** Returns the centre of the tool and the obstacles around it, and the distance from which all are visible. p: pose of the tool. */
  around(p) {
    const target = p ? new THREE.Vector3(p[0], p[1], p[2]) : this.ghost ? this.ghost.position.clone() : new THREE.Vector3();
    const box = new THREE.Box3();
    for (const body of this.obstacles) {
      const mesh = body.children[0].geometry;
      if (mesh instanceof THREE.PlaneGeometry) continue;
      body.updateMatrixWorld(true);
      mesh.computeBoundingBox();
      box.union(mesh.boundingBox.clone().applyMatrix4(body.matrixWorld));
    }
    box.expandByPoint(target.clone().addScalar(1.2 * this.size)).expandByPoint(target.clone().addScalar(-1.2 * this.size));
    const sphere = box.getBoundingSphere(new THREE.Sphere());
    const radius = Math.min(sphere.radius, 12 * this.size);  // keeps the tool visible in large scenes
    const centre = radius < sphere.radius ? target : sphere.center;
    return { centre: centre.clone(), distance: (0.95 * radius) / Math.sin((this.camera.fov * Math.PI) / 360) };
  }

  /**
   * Moves the camera so that the tool and the obstacles around it are visible. from: a name of VIEWPOINTS; without one, from
   * the viewpoint of the scene, else from above and from the side.
   */
  fit(p, from) {
    const { centre, distance } = this.around(p);
    this.camera.position.copy(centre).addScaledVector(new THREE.Vector3(...(VIEWPOINTS[from] ?? [-0.62, -0.78, 0.55])).normalize(), distance);
    if (this.view && !from) {
      this.camera.position.set(...this.view.eye_m);
      centre.set(...this.view.target_m);
    }
    const chosen = this.camera.position.distanceTo(centre);
    this.camera.near = Math.min(chosen, distance) / 200;
    this.camera.far = Math.max(chosen, distance) * 60;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(centre);
    this.controls.update();
    this.fitted = true;
    this.touched = from !== undefined;
    this.changed = true;
  }

  /** on: from now on the camera moves with the tool; otherwise it rests. */
  follow(on) {
    this.followed = on && this.ghost ? this.ghost.position.clone() : null;
  }

  followTool() {
    const moved = this.ghost.position.clone().sub(this.followed);
    this.followed.copy(this.ghost.position);
    this.camera.position.add(moved);
    this.controls.target.add(moved);
    this.controls.update();
  }

  /** Returns the distance along the line of sight to the tool at this point of the screen [m]; null if another thing is there. */
  distanceToTool({ clientX, clientY }) {
    if (!this.tool) return null;
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height), this.camera);
    const bodies = [this.tool, this.ghost].filter(({ visible }) => visible);
    const hit = ray.intersectObjects(bodies.map((body) => body.children[0]), false)[0];
    if (!hit) return null;
    const { forward } = this.screenAxes();
    return hit.point.sub(this.camera.position).dot(new THREE.Vector3(...forward));
  }

  /** Returns the unit vectors of the screen in the world. */
  screenAxes() {
    this.camera.updateMatrixWorld();
    const axis = (i) => new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, i);
    return { right: axis(0).toArray(), up: axis(1).toArray(), forward: axis(2).negate().toArray() };
  }

  /** Returns a length of 1, 2 or 5 times a power of ten [m], its width on the screen, and the force whose arrow has this length. */
  scale() {
    const m_per_px = this.metresPerPixel(this.camera.position.distanceTo(this.controls.target));
    const length_m = round125(110 * m_per_px);
    return { length_m, width_px: length_m / m_per_px, force_N: length_m / (this.size * ARROW_RADII_PER_N) };
  }

  metresPerPixel(distance_m) {
    return (2 * distance_m * Math.tan((this.camera.fov * Math.PI) / 360)) / this.canvas.clientHeight;
  }

  /** Returns the point of the screen at which a point of the world is drawn. */
  onScreen(point) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    this.camera.updateMatrixWorld();
    const at = new THREE.Vector3(...point).project(this.camera);
    return [left + (width * (at.x + 1)) / 2, top + (height * (1 - at.y)) / 2];
  }

  toolOnScreen() {
    return this.onScreen(this.tool.position.toArray());
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.changed = true;
  }

  /**
   * Draws a frame. A pause as long as the frame time follows a slow frame, to leave processor time to other programs. If
   * most frames are slow, moving scenes are drawn with simplified meshes.
   */
  draw(now) {
    if (this.drawnAt !== undefined) {
      const took = now - this.drawnAt;
      this.slow_ms = took > 40 ? Math.min(took, 1000) : 0;
      this.rested = now + this.slow_ms;
      if (!this.simplified) this.usual_ms = (this.usual_ms ?? 0) + (Math.min(took, MOST_MS) - (this.usual_ms ?? 0)) / OVER_FRAMES;
      this.slow = this.slow || this.usual_ms > SLOW_MS;
      this.drawnAt = undefined;
    }
    if (this.changed) this.changedAt = now;
    const atRest = this.simplified && now - this.changedAt > AT_REST_MS;
    if ((!this.changed && !atRest) || now < (this.rested ?? 0)) return;
    this.drawSimplified(this.slow === true && !atRest);
    this.changed = false;
    this.drawnAt = now;
    this.camera.updateMatrixWorld();
    for (const arrow of [this.force, ...this.contacts.map(({ normal }) => normal)]) arrow.fitInto(this.camera);
    this.renderer.render(this.scene, this.camera);
    this.drawn = (this.drawn ?? 0) + 1;
  }

  /** Returns start and tip of the visible arrows on the screen, for tests. */
  arrows() {
    return [this.force, ...this.contacts.map(({ normal }) => normal)].filter(({ visible }) => visible).map((arrow) => {
      const along = new THREE.Vector3(0, arrow.head.position.y + arrow.head.scale.y, 0).applyQuaternion(arrow.quaternion);
      return [this.onScreen(arrow.position.toArray()), this.onScreen(along.add(arrow.position).toArray())];
    });
  }

  /** Returns the drawn poses and camera, for tests. */
  inspect() {
    const pose = (body) => (body?.visible ? [...body.position.toArray(), ...body.quaternion.toArray()] : null);
    return {
      tool: pose(this.tool),
      ghost: pose(this.ghost),
      second: pose(this.second),
      obstacles: this.obstacles.map(pose),
      contacts: this.contacts.filter(({ point }) => point.visible).map(({ point }) => point.position.toArray()),
      force: this.force.visible ? new THREE.Vector3(0, 1, 0).applyQuaternion(this.force.quaternion).toArray() : null,
      sceneCount: this.sceneCount,
      simplified: this.simplified === true,
      eye: this.camera.position.toArray(),
      target: this.controls.target.toArray(),
      triangles: this.renderer.info.render.triangles,
      drawn: this.drawn ?? 0,
    };
  }
}
