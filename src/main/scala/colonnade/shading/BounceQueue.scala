package colonnade.shading

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.common.{Context, ContextTable, ReservedQueue}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{FrameRegisters, Lobe, Material, MaterialKind, Rgb, Vec3}

/** A hit on a mirror or glass. */
final class BounceHit(config: PathConfig) extends Bundle {
  val context  = Context(config)
  val material = MaterialIndex(config)
  val backSide = Bool()

  /** The normal is a microfacet's. */
  val isRough = Lobe(config.device).map(_ => Bool())
}

/** Components of vectors that are known early: the geometric normal, turned against the ray, and the ray's direction.
  */
final class BounceDirections(config: PathConfig) extends Bundle {
  val faceForwardNormal = SInt((NumberFormats.normalBits + 1).W)
  val dir               = SInt((new ShaderFormats(config.numbers).shadeBits + 1).W)
}

/** Components of vectors that are known late: the reflection's origin and the shading normal; and what kind of normal
  * it is.
  */
final class BouncePoint(config: PathConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val origin   = SInt(formats.pointBits.W)
  val normal   = SInt(formats.narrowBits.W)
  val isSmooth = Bool()
}

final class BounceQueueIO(config: PathConfig) extends Bundle {
  val materials = Input(Vec(config.device.frame.materials, new Material(config.device)))

  // Each only while there is space
  val hit        = Flipped(Valid(new BounceHit(config)))
  val directions = Vec(3, Flipped(Valid(new BounceDirections(config))))
  val points     = Vec(3, Flipped(Valid(new BouncePoint(config))))
  val albedo     = Flipped(new AlbedoSources(config))

  /** The normals of microfacets, of the rough ones of the hits. */
  val facet = Lobe(config.device).map(_ => Flipped(Valid(Vec(3, SInt((ScatterStage.facetBits + 1).W)))))

  // To and from bounce units, which may answer in any order
  val request = Decoupled(new BounceRequest(config))
  val result  = Flipped(Decoupled(new BounceResult(config)))
  val bounced = Decoupled(new BouncedRay(config))
}

/** What a path needs besides the bounce. */
final private class BounceSurface(config: PathConfig) extends Bundle {
  val material = MaterialIndex(config)
  val backSide = Bool()
  val albedo   = Option.when(config.device.geometry.cornerColours)(Rgb(FrameRegisters.colour))
  val origin   = Vec(3, SInt(new ShaderFormats(config.numbers).pointBits.W)) // of a reflection
}

/** Hits on mirrors and glass on their way from the [[ShadingPipeline]] to the bounce units, in order, and their bounces
  * on the way back, which meet what is stored of their surface. A result is offered in the cycle after it came.
  *
  * @param places of the queues
  */
final class BounceQueue(config: PathConfig, places: Int) extends Module {
  val io = IO(new BounceQueueIO(config))

  private def queue[T <: Data](in: Valid[T]) = {
    val queue = Module(new ReservedQueue(in.bits.cloneType, places)).io
    queue.in          := in
    queue.mayTakeNext := true.B
    queue.out
  }

  private val hits       = queue(io.hit)
  private val directions = io.directions.map(queue(_))
  private val points     = io.points.map(queue(_))
  private val facets     = io.facet.map(queue(_))
  private val isRough    = hits.bits.isRough.getOrElse(false.B)
  private val all        = (hits +: directions) ++ points
  private val request    = io.request.bits
  private val hit        = hits.bits
  private val material   = ShadingPipeline.material(config, io.materials, hit.material)
  private val albedo     = new ObjectAlbedo(config, io.albedo, material, true.B, io.request.fire, places)
  io.request.valid := all.map(_.valid).reduce(_ && _) && albedo.isKnown && facets.fold(true.B)(_.valid || !isRough)
  all.foreach(_.ready := io.request.fire)
  facets.foreach(_.ready := io.request.fire && isRough)

  request.context  := hit.context
  request.origin   := Vec3.of(points.map(_.bits.origin))
  request.normal   := Vec3.of(points.map(_.bits.normal))
  request.isSmooth := points.head.bits.isSmooth
  for (facet <- facets) when(isRough) {
    val low = new ShaderFormats(config.numbers).shadeBits - ScatterStage.facetBits
    request.normal   := Vec3.of(facet.bits.map(component => (component << low).asSInt))
    request.isSmooth := true.B
  }
  request.faceForwardNormal := Vec3.of(directions.map(_.bits.faceForwardNormal))
  request.dir               := Vec3.of(directions.map(_.bits.dir))
  request.backSide          := hit.backSide
  request.isGlass           := material.kind.get === MaterialKind.glass
  request.eta               := Mux(hit.backSide, material.etaBack.get, material.etaFront.get)
  request.reflectance       := material.reflectance.get

  // Surfaces of bounces under way. The entry of an offered result is read again and again until the result is taken
  private val table = ContextTable(config, new BounceSurface(config))
  private val entry = Wire(new BounceSurface(config))
  entry.material := hit.material
  entry.backSide := hit.backSide
  entry.albedo.foreach(_ := albedo.albedo)
  entry.origin := VecInit(points.map(_.bits.origin))
  when(io.request.fire)(table.write(hit.context, entry))
  private val context = io.result.bits.context
  private val surface = table.read(context, io.result.valid)
  private val isRead  = RegNext(io.result.valid && !io.result.fire, false.B) && RegNext(context) === context
  private val bounced = io.bounced.bits
  private val ofRay   = ShadingPipeline.material(config, io.materials, surface.material)
  io.bounced.valid := io.result.valid && isRead
  io.result.ready  := io.bounced.ready && isRead
  bounced.bounce   := io.result.bits
  when(!io.result.bits.isRefraction) { bounced.bounce.origin := Vec3.of(surface.origin) }
  bounced.albedo   := surface.albedo.getOrElse(ofRay.albedo)
  bounced.isTinted := !surface.backSide || ofRay.kind.get === MaterialKind.mirror
  bounced.fresnelOrigin.foreach(_ := Vec3.of(surface.origin))
}
