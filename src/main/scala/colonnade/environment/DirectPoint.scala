package colonnade.environment

import chisel3._
import chisel3.util.{Cat, Decoupled}
import colonnade.config.PathConfig
import colonnade.formats.{AlbedoEntry, EnvironmentView, NormalEntry, Vec3}
import colonnade.numbers.{Fixed, Normalise, Rounding}
import colonnade.ray.RayFormats

/** A pixel on its way through the [[DirectView]]. */
final class DirectPixel(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)

  val request     = new EnvironmentRequest(config)
  val dir         = Vec(3, SInt((formats.f + 1).W)) // scaled to f bits
  val hitDistance = HitDistance(config)
}

final class DirectPointIO(config: PathConfig) extends Bundle {
  val view   = Input(new EnvironmentView(config.numbers))
  val origin = Input(Vec3(new Fixed(new RayFormats(config.numbers).scene))) // the camera's position, grid steps

  /** Of the same pixel; they are offered until they are taken. Albedo and normal of hits only. */
  val pixel    = Flipped(Decoupled(new DirectPixel(config)))
  val distance = Flipped(Decoupled(new DirectDistance(config)))
  val albedo   = Flipped(Decoupled(new AlbedoEntry))
  val normal   = Flipped(Decoupled(new NormalEntry))

  val answer = Decoupled(new MarchAnswer(config)) // offered until it is taken
}

/** Position and normal of a directly seen point, and whether it hides the object's hit. A pixel every four cycles, by one
  * multiplier for the position and three for the normal.
  */
final class DirectPoint(config: PathConfig) extends Module {
  private val formats = new MarchFormats(config.device)
  import DirectView.latch
  import formats._

  val io = IO(new DirectPointIO(config))

  private val isHeld = RegInit(false.B)
  private val at     = Reg(UInt(2.W))
  private val isDone = RegInit(false.B) // the pixel before waits for its answer to be taken
  private val found  = latch(io.distance.bits, io.distance.fire)
  private val pixel  = io.pixel.bits
  // From its first step on, a pixel is ready until its last one. Its albedo may come later, behind that of the pixel before
  private val isReady  = io.pixel.valid && (!found.isHit || io.normal.valid)
  private val takes    = io.answer.fire
  private val moves    = isHeld && isReady && (at =/= 1.U || !isDone || takes)
  private val isLast   = isHeld && at === 3.U
  private val advances = at =/= 1.U || moves // sum and offset of the pixel before stay until its answer is taken
  io.distance.ready := !isHeld || isLast
  when(io.distance.fire) {
    isHeld := true.B
    at     := 0.U
  }.elsewhen(isLast) { isHeld := false.B }.elsewhen(moves) { at := at + 1.U }
  when(isLast) { isDone := true.B }.elsewhen(takes) { isDone := false.B }
  io.pixel.ready  := isLast
  io.normal.ready := isLast && found.isHit

  // Two cycles for each axis: distance · direction, shifted to grid steps; then the position
  private val product = latch(found.distance.zext * VecInit(pixel.dir :+ pixel.dir(0))(at), advances)
  private val shift   = f.S - found.exponent
  private val limit   = product.getWidth + f
  private val amount  =
    latch(Mux(shift < 0.S, 0.U, Mux(shift >= limit.S, limit.U, shift.asUInt))(Normalise.exponentBits(limit) - 1, 0))
  private val isNegative = latch(shift < 0.S)
  private val offset     = Reg(SInt(sceneBits.W))
  private val scaled     = (Cat(product, 0.U(f.W)).asSInt >> amount).asSInt
  private val length     = Normalise.bitLength(Mux(product < 0.S, ~product, product).asUInt)
  private val exceeds    = product =/= 0.S && (isNegative || length.zext +& (f - sceneBits + 1).S > amount.zext)
  private val most       = ((BigInt(1) << (sceneBits - 1)) - 1).S(sceneBits.W)
  when(isHeld && at =/= 0.U && advances) {
    offset := Mux(exceeds, Mux(product < 0.S, ~most, most), Rounding.narrow(scaled.pad(sceneBits), sceneBits))
  }
  private val axis      = Mux(isHeld, at, 0.U)
  private val origin    = VecInit(io.origin.axes.map(_.integer))(Mux(axis < 2.U, 2.U, axis - 2.U))
  private val point     = SurfacePoint.clamped(offset +& origin)
  private val travelled = Mux(offset < 0.S, ~offset, offset).asUInt
  private val reach     = latch(pixel.hitDistance, isLast)
  private val isNearer  = travelled +& io.view.occlusionTolerance < Mux(isLast || at === 2.U, pixel.hitDistance, reach)
  private val wasNearer = Reg(Bool())
  private val x         = latch(point, isHeld && at === 2.U)
  private val y         = latch(point, isLast)
  when(isHeld && at === 2.U) { wasNearer := isNearer }.elsewhen(isLast) { wasNearer := wasNearer && isNearer }

  // The normal, a component at a time for all axes of its rotation
  private val components = Seq(io.normal.bits.x, io.normal.bits.y, io.normal.bits.z).map(_.integer)
  private val component  = VecInit(components :+ components.head)(at)
  private val normal     = io.view.rotation.map { row =>
    val term = latch(component * VecInit(row.axes.map(_.integer) :+ row.axes.head.integer)(at), advances)
    val sum  = Reg(SInt(SurfacePoint.rotationBits.W))
    when(isHeld && at === 1.U && moves) { sum := term }.elsewhen(isHeld && at(1)) { sum := sum + term }
    SurfacePoint.rotated(sum)
  }

  // The answer
  private val answer  = io.answer.bits
  private val request = latch(pixel.request, isLast)
  private val isHit   = latch(found.isHit, isLast)
  io.answer.valid        := isDone && (!isHit || io.albedo.valid)
  io.albedo.ready        := takes && isHit
  answer.isOcclusionTest := request.isOcclusionTest
  answer.isHit           := isHit && (!request.isOcclusionTest || (wasNearer && isNearer))
  answer.surface.context := request.context
  answer.surface.shadows := !request.isFresnelReflection
  answer.surface.point.axes.zip(Seq(x, y, point)).foreach { case (to, from) => to := Fixed(to.format, from) }
  answer.surface.normal.axes.zip(normal).foreach { case (to, from) => to := from }
  private val albedo = io.albedo.bits
  answer.surface.albedo.channels.zip(Seq(albedo.r, albedo.g, albedo.b)).foreach { case (to, from) => to := from }
}
