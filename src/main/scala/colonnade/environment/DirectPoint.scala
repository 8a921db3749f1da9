package colonnade.environment

import chisel3._
import chisel3.util.{Cat, Decoupled}
import colonnade.config.PathConfig
import colonnade.formats.EnvironmentView
import colonnade.numbers.{Fixed, Normalise, Rounding}

/** A pixel on its way through the [[DirectView]], or the ray of a march. */
final class DirectPixel(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)

  val request     = new EnvironmentRequest(config)
  val dir         = Vec(3, SInt((formats.f + 1).W)) // scaled to f bits
  val hitDistance = HitDistance(config)
}

final class DirectPointIO(config: PathConfig) extends Bundle {
  val view = Input(new EnvironmentView(config.numbers))

  /** Directly seen pixels, and hits of marches. The second source goes first; it offers a distance only with all other
    * parts.
    */
  val sources = Vec(2, Flipped(new PointSource(config)))

  val answer = Decoupled(new MarchAnswer(config)) // offered until it is taken
}

/** Position and normal of a directly seen point, or of a march's hit, and whether it hides the object's hit. A point
  * every four cycles, by one multiplier for the position and three for the normal.
  */
final class DirectPoint(config: PathConfig) extends Module {
  private val formats = new MarchFormats(config.device)
  import DirectView.latch
  import formats._

  val io = IO(new DirectPointIO(config))

  private val isHeld = RegInit(false.B)
  private val at     = Reg(UInt(2.W))
  private val isDone = RegInit(false.B) // the pixel before waits until it is taken

  // The source of the next point, of the one that is held, and of the one that leaves
  private val selected = io.sources(1).distance.valid.asUInt
  private val mayEnter = WireInit(false.B)
  private val enters   = mayEnter && io.sources.map(_.distance.valid).reduce(_ || _)
  private val source   = latch(selected, enters)
  private val leaving  = Reg(UInt(1.W))
  private val found    = latch(of(selected)(_.distance.bits), enters)
  private val pixel    = of(source)(_.pixel.bits)
  private val texel    = of(source)(_.normal.bits)
  // From its first step on, a pixel is ready until its last one. Its albedo may come later, behind the last pixel's
  private val isReady  = of(source)(_.pixel.valid) && (!found.isHit || of(source)(_.normal.valid))
  private val takes    = io.answer.fire
  private val moves    = isHeld && isReady && (at =/= 1.U || !isDone || takes)
  private val isLast   = isHeld && at === 3.U
  private val advances = at =/= 1.U || moves // sum and offset of the pixel before stay until it is taken
  mayEnter := !isHeld || isLast
  when(enters) {
    isHeld := true.B
    at     := 0.U
  }.elsewhen(isLast) { isHeld := false.B }.elsewhen(moves) { at := at + 1.U }
  when(isLast) { isDone := true.B }.elsewhen(takes) { isDone := false.B }
  when(isLast)(leaving := source)
  for ((from, index) <- io.sources.zipWithIndex) {
    from.distance.ready := mayEnter && selected === index.U
    from.pixel.ready    := isLast && source === index.U
    from.normal.ready   := isLast && source === index.U && found.isHit
  }

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
  private val origins   = of(source)(_.origin).axes.map(_.integer)
  private val last      = latch(origins(2), isLast)
  private val origin    = Mux(isHeld && at(1), Mux(at(0), origins(1), origins(0)), last)
  private val point     = SurfacePoint.clamped(offset +& origin)
  private val travelled = Mux(offset < 0.S, ~offset, offset).asUInt
  private val reach     = latch(pixel.hitDistance, isLast)
  private val isNearer  = travelled +& io.view.occlusionTolerance < Mux(isLast || at === 2.U, pixel.hitDistance, reach)
  private val wasNearer = Reg(Bool())
  private val x         = latch(point, isHeld && at === 2.U)
  private val y         = latch(point, isLast)
  private val isAway    = travelled > io.view.occlusionTolerance
  private val wasAway   = Reg(Bool()) // off the ray's origin; a camera stands on no surface
  private val mayHide   = latch(found.mayHide, isLast)
  when(isHeld && at === 2.U) {
    wasNearer := isNearer
    wasAway   := isAway || pixel.request.isDirectView
  }.elsewhen(isLast) {
    wasNearer := wasNearer && isNearer
    wasAway   := wasAway || isAway
  }

  // The normal, a component at a time for all axes of its rotation
  private val components = Seq(texel.x, texel.y, texel.z).map(_.integer)
  private val component  = VecInit(components :+ components.head)(at)
  private val normal     = io.view.rotation.map { row =>
    val term = latch(component * VecInit(row.axes.map(_.integer) :+ row.axes.head.integer)(at), advances)
    val sum  = Reg(SInt(SurfacePoint.rotationBits.W))
    when(isHeld && at === 1.U && moves) { sum := term }.elsewhen(isHeld && at(1)) { sum := sum + term }
    SurfacePoint.rotated(sum)
  }

  // The answer
  private val result  = io.answer.bits
  private val request = latch(pixel.request, isLast)
  private val isHit   = latch(found.isHit, isLast)
  private val albedo  = of(leaving)(_.albedo.bits)
  io.answer.valid                                                  := isDone && (!isHit || of(leaving)(_.albedo.valid))
  for ((from, index) <- io.sources.zipWithIndex) from.albedo.ready := takes && isHit && leaving === index.U
  result.isOcclusionTest                                           := request.isOcclusionTest
  result.isHit := isHit && (!request.isOcclusionTest || (mayHide && wasNearer && isNearer && (wasAway || isAway)))
  result.surface.context := request.context
  result.surface.shadows := !request.isFresnelReflection
  result.surface.point.axes.zip(Seq(x, y, point)).foreach { case (to, from) => to := Fixed(to.format, from) }
  result.surface.normal.axes.zip(normal).foreach { case (to, from) => to := from }
  result.surface.albedo.channels.zip(Seq(albedo.r, albedo.g, albedo.b)).foreach { case (to, from) =>
    to := from
  }

  /** A part of a source; as a number, because firtool writes no multiplexer of vectors. */
  private def of[T <: Data](source: UInt)(part: PointSource => T): T =
    Mux(source(0), part(io.sources(1)).asUInt, part(io.sources(0)).asUInt).asTypeOf(part(io.sources(0)))
}
