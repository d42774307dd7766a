// The 3D view of a shape in a notebook cell: boxes with coloured faces and dark edges, turned with the mouse.
//
// Build (writes shape_view.bundle.js, which is committed so that readers need no Node):
//     cd lib/viewing/js && npm install && npm run build
//
// Python sends one buffer of little-endian float32, STRIDE numbers a box: size 3, center 3, axes 9 (rows right, top,
// front), colour 3 (0..1); and a list of part names, one a box. World: x right, y up, z to the front.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const STRIDE = 18;
const CUBE = new THREE.BoxGeometry(1, 1, 1);
const CUBE_EDGES = new THREE.EdgesGeometry(CUBE);
const LOOK_FROM = new THREE.Vector3(0.49, 0.37, 0.79); // 32 degrees to the right, 22 up: as the printed pictures

function readBoxes(view) {
  const values = new Float32Array(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));
  return Array.from({ length: values.length / STRIDE }, (_, i) => values.subarray(i * STRIDE, (i + 1) * STRIDE));
}

function addLights(scene) {
  scene.add(new THREE.HemisphereLight(0xffffff, 0xb9bfca, 2.1));
  const sun = new THREE.DirectionalLight(0xffffff, 1.5);
  sun.position.set(-0.35, 0.75, 0.56).multiplyScalar(10);
  scene.add(sun);
}

// One box: a mesh that can be picked, and its edges as a child, so that both move together.
function makeBox() {
  const surface = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 }; // edges stay in front
  const box = new THREE.Mesh(CUBE, new THREE.MeshLambertMaterial({ ...surface, side: THREE.DoubleSide }));
  box.add(new THREE.LineSegments(CUBE_EDGES, new THREE.LineBasicMaterial()));
  box.matrixAutoUpdate = false;
  return box;
}

function placeBox(box, v) {
  const [l, h, w] = v;
  const axis = (k, length) => new THREE.Vector3(v[6 + 3 * k], v[7 + 3 * k], v[8 + 3 * k]).multiplyScalar(length);
  box.matrix.makeBasis(axis(0, l), axis(1, h), axis(2, w)).setPosition(v[3], v[4], v[5]);
  box.matrixWorldNeedsUpdate = true;
  box.material.color.setRGB(v[15], v[16], v[17], THREE.SRGBColorSpace);
  box.children[0].material.color.copy(box.material.color).multiplyScalar(0.12);
}

function removeBox(group, box) {
  group.remove(box);
  box.material.dispose();
  box.children[0].material.dispose();
}

// The camera frames the FIRST shape only: afterwards a change of size must be seen as one.
function frame(group, camera, controls) {
  const sphere = new THREE.Box3().setFromObject(group).getBoundingSphere(new THREE.Sphere());
  const radius = Math.max(sphere.radius, 1e-3);
  const distance = (radius * 1.08) / Math.sin(THREE.MathUtils.degToRad(camera.fov / 2));
  controls.target.copy(sphere.center);
  camera.position.copy(sphere.center).addScaledVector(LOOK_FROM.clone().normalize(), distance);
  camera.near = distance / 100;
  camera.far = distance * 100;
  camera.updateProjectionMatrix();
  controls.update();
}

function partUnder(event, canvas, camera, group) {
  const area = canvas.getBoundingClientRect();
  const x = ((event.clientX - area.left) / area.width) * 2 - 1;
  const y = 1 - ((event.clientY - area.top) / area.height) * 2;
  const ray = new THREE.Raycaster();
  ray.setFromCamera(new THREE.Vector2(x, y), camera);
  const hit = ray.intersectObjects(group.children, false)[0];
  return hit ? group.children.indexOf(hit.object) : -1;
}

function save(message, buffers) {
  const link = document.createElement("a");
  link.download = message.download;
  link.href = URL.createObjectURL(new Blob(buffers));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function render({ model, el }) {
  const place = document.createElement("div");
  place.className = "shape-view";
  place.style.cssText = `position:relative;width:100%;height:${model.get("height")}px;touch-action:none`;
  const label = document.createElement("div");
  label.className = "shape-view-name";
  label.style.cssText =
    "position:absolute;left:8px;bottom:6px;font:12px monospace;color:#333;background:#fffc;padding:1px 5px;" +
    "border-radius:3px;pointer-events:none";
  const renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
  const canvas = renderer.domElement;
  place.append(canvas, label);
  el.append(place);

  const scene = new THREE.Scene();
  const group = new THREE.Group();
  scene.add(group);
  addLights(scene);
  const camera = new THREE.PerspectiveCamera(25, 1, 0.01, 100);
  const controls = new OrbitControls(camera, canvas);

  let pending = 0;
  let framed = false;
  const draw = () => {
    pending = 0;
    renderer.render(scene, camera);
    place.dataset.draws = Number(place.dataset.draws ?? 0) + 1; // lets a test wait for a picture, not for a time
  };
  const redraw = () => (pending ||= requestAnimationFrame(draw)); // at most one picture a frame
  const update = () => {
    const boxes = readBoxes(model.get("boxes"));
    while (group.children.length > boxes.length) removeBox(group, group.children.at(-1));
    while (group.children.length < boxes.length) group.add(makeBox());
    boxes.forEach((values, i) => placeBox(group.children[i], values));
    if (!framed && boxes.length) frame(group, camera, controls);
    framed ||= boxes.length > 0;
    redraw();
  };
  const resize = () => {
    const [width, height] = [place.clientWidth, place.clientHeight];
    if (!width || !height) return; // the cell is hidden
    renderer.setPixelRatio(window.devicePixelRatio);
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    redraw();
  };
  const point = (event) => {
    const part = partUnder(event, canvas, camera, group);
    label.textContent = part < 0 ? "" : model.get("names")[part];
    canvas.style.cursor = part < 0 ? "grab" : "pointer";
  };

  const watcher = new ResizeObserver(resize);
  watcher.observe(place);
  controls.addEventListener("change", redraw);
  canvas.addEventListener("pointermove", point);
  canvas.addEventListener("pointerdown", point);
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault()); // else it is never given back
  canvas.addEventListener("webglcontextrestored", redraw);
  model.on("change:boxes", update);
  model.on("msg:custom", save);
  update();
  resize();

  return () => {
    model.off("change:boxes", update);
    model.off("msg:custom", save);
    cancelAnimationFrame(pending);
    watcher.disconnect();
    controls.dispose();
    while (group.children.length) removeBox(group, group.children[0]);
    renderer.dispose();
    renderer.forceContextLoss(); // browsers keep about 16 contexts: give this one back now
  };
}

export default { render };
