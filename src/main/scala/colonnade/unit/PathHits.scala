package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.common.{Choice, ContextTable}
import colonnade.config.PathConfig
import colonnade.formats.{InstanceNumber, Leaf, ObjectInstance, RecordBroadcast, RecordFormats, RecordRequest, SceneMap}
import colonnade.numbers.Fixed
import colonnade.ray.{PreparedRay, RayFormats, RayRequest, TriangleRay}
import colonnade.shading.{Occlusion, ShadingPipeline}
import colonnade.traversal.HitPoint

/** What the resolution of a hit needs. */
private final class ClosestHit(config: PathConfig) extends Bundle {
  val id = UInt(RecordFormats.idBits(config.device).W) // packed triangle id

  /** From where the ray enters the box, along its dominant axis. */
  val t = new Fixed(new RayFormats(config.numbers).grid)

  val instance = InstanceNumber(config.device)
}

final class PathHitsIO(config: PathConfig) extends Bundle {
  val start = Input(Bool())
  val scene = Input(new SceneMap(config.device))
  val trace = Flipped(new TracePort(config)) // to the path unit

  /** Rays that enter the object's box; what they have met. An [[InstanceWalk]] adds visits' rays, and reads rays. */
  val rays    = Decoupled(new PreparedRay(config))
  val results = Flipped(Valid(new TraceResult(config)))

  val visits    = Option.when(config.device.frame.hasInstances)(Flipped(Decoupled(new RayRequest(config))))
  val worldRays = Option.when(config.device.frame.hasInstances)(Flipped(new WorldRayRead(config)))

  /** To the column's records, for attributes. */
  val requests   = Decoupled(new RecordRequest(config.device))
  val broadcasts = Flipped(Vec(config.device.columnBvhMemory.banks, Valid(new RecordBroadcast(config.device))))
  val events     = Output(new FetchEvents(AttributeFetch.slotConfig(config.device)))

  /** Objects with transforms of their own. */
  val instances = Option.when(config.device.frame.hasInstances) {
    Input(Vec(config.device.frame.instances, new ObjectInstance(config.device)))
  }

  /** By material: its colour depends on the companion of a leaf. */
  val wantsColours = scene.hasColours.map(_ => Input(Vec(config.device.frame.materials, Bool())))
}

/** Stands between a path unit and the traversal units that trace its rays: forwards rays, keeps the hit of each
  * context, and joins a hit that is to be shaded with its ray and its attributes.
  */
final class PathHits(config: PathConfig) extends Module {
  private val paths = config

  val io = IO(new PathHitsIO(config))

  private val trace   = io.trace
  private val control = trace.control

  // Forward a ray, or end its trace at once if it misses the object's box
  private val ray     = trace.rays.bits
  private val goesOn  = ray.visit.fold(ray.enters)(ray.enters || _.valid)
  private val isWorld = ray.visit.fold(true.B)(!_.valid)
  io.rays.valid         := trace.rays.valid && goesOn
  io.rays.bits          := ray
  trace.rays.ready      := !goesOn || io.rays.ready
  control.entered.valid := io.rays.fire && isWorld
  control.entered.bits  := ray.context
  private val misses = trace.rays.valid && !goesOn
  trace.visits.zip(io.visits).foreach { case (to, from) => to :<>= from }

  // Results. Rays that miss the box have a table of their own, so that each table has one writer
  private val result   = io.results.bits
  private val ends     = io.results.valid && result.visit.fold(true.B)(_.isLast)
  private def isHit    = io.results.valid && result.visit.fold(result.hasHit)(_.isNearer)
  private val query    = Choice(control.query, control.queryNext)
  private val entered  = new FlagTable(paths, Bool())
  private val outcomes = new FlagTable(paths, UInt((1 + Occlusion.getWidth).W))
  private val outcome  = Mux(entered.read(query).asBool, outcomes.read(query), false.B ## Occlusion.none.asUInt)
  entered.write(trace.rays.fire && isWorld, ray.context, ray.enters)
  outcomes.write(ends, result.context, result.hasHit ## result.occlusion.asUInt)
  control.hasHit          := outcome.head(1).asBool
  control.occlusion       := Occlusion.safe(outcome.tail(1))._1
  control.missesBox.valid := misses
  control.missesBox.bits  := ray.context
  control.hasResult.valid := ends
  control.hasResult.bits  := result.context

  // Tables: what the resolution of a hit reads, and what its shading reads
  private val closest = ContextTable(paths, new ClosestHit(config))
  private val hits    = ContextTable(paths, new HitPoint(config))
  private val rays    = ContextTable(paths, new TriangleRay(config.numbers))
  private val writes  = io.rays.fire && isWorld && !ray.isShadow // nobody shades what a shadow ray hits
  when(if (io.worldRays.isEmpty) writes else io.rays.fire && isWorld) { rays.write(ray.context, ray.ray.forTriangles) }
  when(isHit) {
    val entry = Wire(new ClosestHit(config))
    entry.id                                                 := result.hit.id
    entry.t                                                  := result.hit.t
    for ((to, visit) <- entry.instance.zip(result.visit)) to := visit.instance
    closest.write(result.context, entry)
    hits.write(result.context, result.hit.point)
  }

  // A hit with a surface to shade, or whose distance is measured
  private val shades   = control.startsShading
  private val distance = control.readsDistance
  private val reads    = shades || distance.valid
  private val readHit  = Mux(distance.valid, distance.bits, control.query.bits)
  private val hit      = closest.read(readHit, reads)
  private val context  = RegEnable(readHit, reads)
  trace.surfaceHit.valid          := RegNext(shades, false.B)
  trace.surfaceHit.bits.context   := context
  trace.surfaceHit.bits.isPrimary := RegNext(control.isPrimary)
  trace.surfaceHit.bits.id        := hit.id
  trace.surfaceHit.bits.t         := hit.t
  trace.surfaceHit.bits.instance.zip(hit.instance).foreach { case (to, from) => to := from }
  for (measured <- trace.surfaceHit.bits.distance) {
    val entries = ContextTable(paths, UInt(config.numbers.entryBits.W))
    when(writes) { entries.write(ray.context, ray.tEntry.natural) }
    measured := SurfaceHit.distance(config, entries.read(readHit, reads), hit.t)
  }
  assert(!(shades && distance.valid), "one hit is read in a cycle")

  // Its attributes
  private val attributes = Module(new AttributeFetch(config)).io
  private val decoder    = Module(new LeafDecoder(config)).io
  private val record     = attributes.response.bits
  attributes.start             := io.start
  attributes.scene             := io.scene
  attributes.broadcasts        := io.broadcasts
  attributes.hits.valid        := trace.surfaceHit.valid
  attributes.hits.bits.context := context
  attributes.hits.bits.id      := hit.id
  attributes.hits.bits.instance.zip(hit.instance).foreach { case (to, from) => to := from }
  attributes.readyNext    := decoder.readyNext
  attributes.wantsColours := io.wantsColours.fold(false.B)(
    ShadingPipeline.material(config, _, materialOf(record))
  )
  trace.attributeError := attributes.error
  io.events            := attributes.events
  io.requests :<>= attributes.requests
  decoder.leaf.valid         := attributes.response.valid && !record.isColours
  decoder.leaf.bits.context  := record.hit.context
  decoder.leaf.bits.isSecond := record.hit.id(0)
  decoder.leaf.bits.record   := record.record
  decoder.leaf.bits.instance.zip(record.hit.instance).foreach { case (to, from) => to := from }
  // Faces: in the axes of their leaves, or with instances in the world's
  private val (granted, offered) = io.instances.fold(facesOfLeaves)(facesInWorld)
  private val face               = offered.bits
  trace.hits.valid                     := offered.valid
  trace.hits.bits.context              := face.context
  trace.hits.bits.ray                  := rayOf(granted)
  trace.hits.bits.hit                  := hits.read(granted.bits, granted.valid)
  trace.hits.bits.face.normals         := face.normals
  trace.hits.bits.face.geometricNormal := face.geometricNormal
  trace.hits.bits.face.material        := face.material
  for (colours <- trace.hits.bits.face.colours) {
    val table   = ContextTable(paths, chiselTypeOf(colours))
    val ofLeaf  = new RecordFormats(config.device).asColours(record.record).colours
    val corners = Leaf.corners.map { case (second, first) => Mux(record.hit.id(0), ofLeaf(second), ofLeaf(first)) }
    when(attributes.response.valid && record.isColours)(table.write(record.hit.context, VecInit(corners)))
    colours := table.read(granted.bits, granted.valid)
  }
  assert(!trace.hits.valid || trace.hits.ready, "the shader does not accept its hit")

  /** The context whose face comes next, and faces, in the axes of their leaves. */
  private def facesOfLeaves: (Valid[UInt], Valid[HitFace]) = {
    decoder.mayTakeNext := trace.hitsReadyNext
    (decoder.grantNext, decoder.face)
  }

  /** The same in the world's axes; without instances leaves have them. */
  private def facesInWorld(instances: Vec[ObjectInstance]): (Valid[UInt], Valid[HitFace]) = {
    val faces       = Module(new WorldFaces(config)).io
    val isOff       = io.scene.instances.get === 0.U
    val mayTakeNext = trace.hitsReadyNext && !io.worldRays.get.context.valid
    faces.objectFace.valid := decoder.face.valid && !isOff
    faces.objectFace.bits  := decoder.face.bits
    faces.instances        := instances
    faces.mayTakeNext      := mayTakeNext
    decoder.mayTakeNext    := Mux(isOff, mayTakeNext, faces.mayComeNext)
    (Mux(isOff, decoder.grantNext, faces.grantNext), Mux(isOff, decoder.face, faces.face))
  }

  /** The ray of a hit that is shaded, which waits while a visit reads one. */
  private def rayOf(hit: Valid[UInt]): TriangleRay = io.worldRays.fold(rays.read(hit.bits, hit.valid)) { visit =>
    visit.ray := rays.read(Mux(visit.context.valid, visit.context.bits, hit.bits), hit.valid || visit.context.valid)
    assert(!(hit.valid && visit.context.valid), "one ray is read in a cycle")
    visit.ray
  }

  /** The material of the face of a leaf, in the scene. */
  private def materialOf(response: AttributeResponse): UInt = {
    val material = new Leaf(config.device.geometry, response.record).material
    io.instances.zip(response.hit.instance).fold(material) { case (instances, number) =>
      Mux(io.scene.instances.get =/= 0.U, material + instances(number).materialBase, material)
    }
  }
}
