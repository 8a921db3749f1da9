package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, Mux1H}
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.{EnvironmentView, Plane}
import colonnade.numbers.{Divider, Normalise, Rounding}

/** The way to a directly seen point: distance · 2^exponent times the ray's direction. */
final class DirectDistance(config: PathConfig) extends Bundle {
  private val formats = new MarchFormats(config.device)

  val isHit    = Bool() // the map shows something there, in front of the camera
  val mayHide  = Bool() // it is a point of the map that the maps' camera sees
  val exponent = SInt(formats.shiftBits.W)
  val distance = UInt((formats.f + 1).W)
}

final class DirectDepthIO(config: PathConfig) extends Bundle {
  val view = Input(new EnvironmentView(config.numbers))

  /** Of the same pixel; they are offered until they are taken, in the same cycle. */
  val place = Flipped(Decoupled(new DirectPlace(config)))
  val rate  = Flipped(Decoupled(new DirectRate(config)))
  val plane = Flipped(Decoupled(new Plane))

  val albedo, normal =
    Decoupled(new MapPixel(AttributeLayout.of(config.device))) // the pixel's albedo and normal are needed
  val distance = Decoupled(new DirectDistance(config)) // in the order of the pixels
}

/** The distance of a directly seen point, from the plane of its pixel: 1 / (w · rate). A pixel every four cycles, by
  * one multiplier for the plane, one for w · rate, and three dividers that take turns.
  */
final class DirectDepth(config: PathConfig) extends Module {
  private val formats = new MarchFormats(config.device)
  import DirectView.latch
  import formats._

  val io = IO(new DirectDepthIO(config))

  // The plane's depth in the pixel
  private val hasAll     = io.place.valid && io.rate.valid && io.plane.valid
  private val plane      = io.plane.bits
  private val at         = RegInit(0.U(2.W))
  private val planeMoves = WireInit(false.B)
  private val product    = latch(Mux(at(0), io.place.bits.v, io.place.bits.u) * Mux(at(0), plane.b, plane.a))
  private val sum        = Reg(SInt((product.getWidth + 1).W))
  when(hasAll && at =/= 3.U) { at := at + 1.U }
  when(planeMoves) { at := 0.U }
  when(at === 1.U) { sum := product }.elsewhen(at === 2.U) { sum := sum +& product }
  private val value = Rounding.floor(sum, f) +& plane.c // minus the depth
  Seq(io.place, io.rate, io.plane).foreach(_.ready := planeMoves)

  // w, then w · rate
  private val isHeld   = RegInit(false.B)
  private val step     = Reg(UInt(2.W))
  private val behind   = latch(value, planeMoves)
  private val rate     = latch(io.rate.bits, planeMoves)
  private val exponent = latch(plane.exponent, planeMoves)
  private val pixel    = latch(io.place.bits.pixel, planeMoves)
  // -⌊-behind · 2^(f - 22 + exponent)⌋
  private val steps      = latch(((0.S -& behind) << exponent).asSInt >> (planeFraction - f))
  private val w          = Rounding.saturate(0.S -& steps, alongBits + 1)
  private val wOrLess    = latch(w, step === 1.U)
  private val isHit      = latch(steps < 0.S && rate.isReceding, step === 1.U)
  private val isWaiting  = RegInit(false.B)
  private val growth     = latch(wOrLess.asUInt(alongBits - 1, 0) * rate.mantissa, step === 2.U && !isWaiting)
  private val asks       = Seq(io.albedo, io.normal).map(port => (port, RegInit(false.B)))
  private val stepMoves  = step =/= 2.U || !isWaiting
  private val stepLeaves =
    isHeld && step === 3.U && asks.map { case (port, asks) => !asks || port.ready }.reduce(_ && _)
  planeMoves := hasAll && at === 3.U && (!isHeld || stepLeaves)
  when(planeMoves) {
    isHeld := true.B
    step   := 0.U
  }.elsewhen(stepLeaves) { isHeld := false.B }.elsewhen(isHeld && step =/= 3.U && stepMoves) { step := step + 1.U }
  for ((port, asks) <- asks) {
    when(isHeld && step === 2.U && stepMoves) { asks := isHit }.elsewhen(port.fire) { asks := false.B }
    port.valid := asks
    port.bits  := pixel
  }

  // Normalise; `growth` stays until a divider takes its mantissa
  private val growthBits = growth.getWidth
  private val zeros      = latch(Normalise.countLeadingZeros(growth)._2, stepLeaves)
  private val mantissa   = (growth << zeros)(growthBits - 1, growthBits - f)
  private val rateOf     = latch(rate.exponent, stepLeaves)
  private val hits       = latch(isHit, stepLeaves)
  private val divides    = WireInit(false.B)
  when(stepLeaves) { isWaiting := true.B }.elsewhen(divides) { isWaiting := false.B }

  // Dividers, in turn
  private val enters = RegInit(1.U(3.W))
  private val ends   = RegInit(1.U(3.W))
  private val shifts = (f + 1 - growthBits).S +& zeros.zext - rateOf.zext +& io.view.exponent
  private val lanes  = Seq.tabulate(3) { lane =>
    val divider = Module(new Divider(f, f)).io
    divider.division.valid            := isWaiting && enters(lane)
    divider.division.bits.numerator   := (BigInt(1) << (f - 1)).U
    divider.division.bits.denominator := mantissa
    divider.quotient.ready            := io.distance.ready && ends(lane)
    val result = Wire(Decoupled(new DirectDistance(config)))
    result.valid         := divider.quotient.valid && ends(lane)
    result.bits.distance := divider.quotient.bits
    result.bits.exponent := latch(shifts, divider.division.fire)
    result.bits.isHit    := latch(hits, divider.division.fire)
    result.bits.mayHide  := true.B
    result.ready         := divider.quotient.ready
    (divider.division, result)
  }
  divides                  := lanes.map(_._1.fire).reduce(_ || _)
  io.distance.valid        := lanes.map(_._2.valid).reduce(_ || _)
  io.distance.bits         := Mux1H(ends, lanes.map(_._2.bits))
  when(divides)(enters        := enters(1, 0) ## enters(2))
  when(io.distance.fire)(ends := ends(1, 0) ## ends(2))
}
