package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled}
import colonnade.config.PartConfig
import colonnade.numbers.{Divider, Fixed, Normalise, Rounding}
import colonnade.ray.RayFormats

final class WeightStageIO(config: PartConfig) extends Bundle {
  val crossed  = Flipped(Decoupled(new CrossedTriangle(config)))
  val weighted = Decoupled(new WeightedTriangle(config))
}

/** Barycentric weights: the edges' magnitudes, shifted so that their sum fills `weightBits`; numbers.md 4.4.
  *
  * One triangle at a time, every 7 cycles: two cycles for the sum, one to count its leading zeros, three to shift the
  * edges through one shifter, one for the output, in which the next triangle may enter.
  */
final class WeightStage(config: PartConfig) extends Module {
  val io = IO(new WeightStageIO(config))

  private object State extends ChiselEnum { val idle, adding, counting, shifting, offering = Value }
  import State._

  private val formats = new TriangleFormats(config.numbers)

  // Control
  private val state   = RegInit(idle)
  private val edge    = Reg(UInt(2.W))
  private val isFinal = edge === Mux(state === adding, 1.U, 2.U)
  io.weighted.valid := state === offering
  io.crossed.ready  := state === idle || io.weighted.fire
  when(state === adding || state === shifting) { edge := Mux(isFinal, 0.U, edge + 1.U) }
  when(state === adding && isFinal) { state := counting }
  when(state === counting) { state := shifting }
  when(state === shifting && isFinal) { state := offering }
  when(io.weighted.fire) { state := idle }
  when(io.crossed.fire) {
    state := adding
    edge  := 0.U
  }

  // Datapath: a ring of three edges, which weights replace one by one
  private val triangle = Reg(new CrossedTriangle(config))
  private val ring     = triangle.magnitudes
  private val total    = Reg(UInt(formats.edgeBits.W))
  private val zeros    = Reg(UInt(formats.zerosBits.W))
  private val sum      = Reg(UInt(formats.weightBits.W))

  private val weight =
    TriangleFormats.shiftLeft(ring(0), zeros)(formats.edgeBits - 1, formats.edgeBits - formats.weightBits)
  private val sumSoFar = Mux(edge === 1.U, 0.U, sum) + ring(2)(formats.weightBits - 1, 0)

  when(state === shifting) {
    ring(0) := ring(1)
    ring(1) := ring(2)
    ring(2) := weight
  }
  when(state === adding) { total := Mux(edge === 0.U, ring(0), total) + Mux(edge === 0.U, ring(1), ring(2)) }
  when(state === counting) { zeros := Normalise.countLeadingZeros(total)._2 }
  when(state === shifting) { sum := sumSoFar }
  when(io.crossed.fire) { triangle := io.crossed.bits }

  io.weighted.bits.weights  := VecInit(ring.map(_(formats.weightBits - 1, 0)))
  io.weighted.bits.sum      := sumSoFar
  io.weighted.bits.depths   := triangle.depths
  io.weighted.bits.id       := triangle.id
  io.weighted.bits.backSide := triangle.backSide
}

final class NumeratorStageIO(config: PartConfig) extends Bundle {
  val weighted = Flipped(Decoupled(new WeightedTriangle(config)))
  val request  = Decoupled(new DistanceRequest(config))
}

/** Prepares the distance as a division of two mantissas; numbers.md 4.5.
  *
  * One triangle at a time, every 7 cycles: four multiplications of a weight by half a rise, magnitude, leading zeros,
  * and the shift in the output cycle.
  */
final class NumeratorStage(config: PartConfig) extends Module {
  val io = IO(new NumeratorStageIO(config))

  private object State extends ChiselEnum { val idle, multiplying, negating, counting, offering = Value }
  import State._

  private val numbers = config.numbers
  private val formats = new TriangleFormats(numbers)

  // Control
  private val state   = RegInit(idle)
  private val beat    = Reg(UInt(2.W))
  private val isFinal = beat === 3.U
  io.request.valid  := state === offering
  io.weighted.ready := state === idle || io.request.fire
  when(state === multiplying) {
    beat := beat + 1.U
    when(isFinal) { state := negating }
  }
  when(state === negating) { state := counting }
  when(state === counting) { state := offering }
  when(io.request.fire) { state := idle }
  when(io.weighted.fire) {
    state := multiplying
    beat  := 0.U
  }

  // Datapath
  private val triangle   = Reg(new WeightedTriangle(config))
  private val numerator  = Reg(SInt((formats.numeratorBits + 1).W))
  private val isNegative = Reg(Bool())
  private val zeros      = Reg(UInt(formats.zerosBits.W))

  // Multiply by the upper halves of the rises, then by the lower ones; an upper half is signed
  private val halfBits = (formats.riseBits + 1) / 2
  private val halves   = VecInit(
    triangle.depths.rises.map(Rounding.floor(_, halfBits).pad(halfBits + 1)) ++
      triangle.depths.rises.map(_.asUInt(halfBits - 1, 0).zext)
  )
  private val isSecond = beat(0)
  private val product  = Mux(isSecond, triangle.weights(2), triangle.weights(1)).zext * halves(beat)
  private val soFar    = Mux(beat === 0.U, 0.S, Mux(isSecond, numerator, (numerator << halfBits).asSInt))

  when(io.weighted.fire) { triangle := io.weighted.bits }
  when(state === multiplying) { numerator := Rounding.narrow(soFar +& product, formats.numeratorBits + 1) }
  when(state === negating) {
    isNegative := numerator < 0.S
    when(numerator < 0.S) { numerator := 0.S - numerator }
  }
  private val magnitude = numerator.asUInt(formats.numeratorBits - 1, 0)
  when(state === counting) { zeros := Normalise.countLeadingZeros(magnitude)._2 }

  private def mantissa(x: UInt): UInt = {
    val (width, bits) = (x.getWidth, formats.mantissaBits)
    if (width >= bits) x(width - 1, width - bits) else Cat(x, 0.U((bits - width).W))
  }

  // The difference of the exponents is gridBits - 3, minus the leading zeros of the numerator, plus the sum's
  // (at most one)
  private val sum     = triangle.sum
  private val isShort = !sum(formats.weightBits - 1)
  private val terms   = io.request.bits.terms
  io.request.bits.dividend := mantissa(TriangleFormats.shiftLeft(magnitude, zeros))
  io.request.bits.divisor  := mantissa(Mux(isShort, (sum << 1)(formats.weightBits - 1, 0), sum))
  terms.first              := triangle.depths.first
  terms.isNegative         := isNegative
  terms.shiftRight         := zeros +& formats.excessDigits.U - isShort
  terms.id                 := triangle.id
  terms.backSide           := triangle.backSide
  terms.weights.zip(triangle.weights).foreach { case (port, weight) =>
    val format = new RayFormats(numbers).weight
    port := Fixed(format, Rounding.floor(weight, formats.weightBits - numbers.barycentricBits))
  }
}

final class DistanceStageIO(config: PartConfig) extends Bundle {
  val request = Flipped(Decoupled(new DistanceRequest(config)))

  /** In the order of requests; t may be negative. */
  val hit = Decoupled(new TriangleHit(config))
}

/** Computes distances by division, in order; numbers.md 4.5.
  *
  * `lanes` dividers work in rotation. A quotient is shifted in one cycle and added in the next.
  *
  * @param lanes number of dividers
  */
final class DistanceStage(config: PartConfig, lanes: Int) extends Module {
  require(lanes >= 1, s"$lanes division lanes; a triangle unit needs at least 1")
  val io = IO(new DistanceStageIO(config))

  private object State extends ChiselEnum { val idle, adding, offering = Value }
  import State._

  private val numbers = config.numbers
  private val formats = new TriangleFormats(numbers)

  private def laneCounter(advances: Bool): UInt = {
    val lane = RegInit(0.U(log2Ceil(lanes).W))
    when(advances) { lane := Mux(lane === (lanes - 1).U, 0.U, lane + 1.U) }
    lane
  }

  // Dividers, each with the terms of its triangle
  private val dividers = Seq.fill(lanes)(Module(new Divider(formats.mantissaBits, formats.digits, digitsPerCycle = 2)))
  private val terms    = Reg(Vec(lanes, new DistanceTerms(config)))
  private val isOccupied = RegInit(VecInit(Seq.fill(lanes)(false.B)))
  private val issueLane  = laneCounter(io.request.fire)
  private val collects   = Wire(Bool())
  private val resultLane = laneCounter(collects)

  // A lane that is not occupied has an idle divider. Its own `ready` would add a path from `hit.ready` to `request`
  private val isDone = VecInit(dividers.map(_.io.quotient.valid))
  io.request.ready := !isOccupied(issueLane)
  for ((divider, lane) <- dividers.zipWithIndex) {
    divider.io.division.valid            := io.request.fire && issueLane === lane.U
    divider.io.division.bits.numerator   := io.request.bits.dividend
    divider.io.division.bits.denominator := io.request.bits.divisor
    divider.io.quotient.ready            := collects && resultLane === lane.U
    when(divider.io.division.fire) {
      terms(lane)      := io.request.bits.terms
      isOccupied(lane) := true.B
    }
    when(divider.io.quotient.fire) { isOccupied(lane) := false.B }
  }

  // Control of the sum
  private val state = RegInit(idle)
  io.hit.valid := state === offering
  collects     := isDone(resultLane) && (state === idle || io.hit.fire)
  when(state === adding) { state := offering }
  when(io.hit.fire) { state := idle }
  when(collects) { state := adding }

  // Datapath of the sum; the quotient's bits above `distanceBits` are zero, and t lies between the vertices
  private val quotients = VecInit(dividers.map(_.io.quotient.bits))
  private val quotient  = Cat(quotients(resultLane), 0.U(formats.missingDigits.W))
  private val distance  = Reg(UInt(formats.distanceBits.W))
  private val sum       = Reg(new DistanceTerms(config))
  private val first     = sum.first.integer
  private val t         = Mux(sum.isNegative, first -& distance.zext, first +& distance.zext)
  when(collects) {
    distance := Rounding.narrow(Rounding.floor(quotient, terms(resultLane).shiftRight), formats.distanceBits)
    sum      := terms(resultLane)
  }
  when(state === adding) { sum.first := Fixed(formats.grid, Rounding.narrow(t, numbers.gridBits)) }

  io.hit.bits.t        := sum.first
  io.hit.bits.id       := sum.id
  io.hit.bits.weights  := sum.weights
  io.hit.bits.backSide := sum.backSide
}
