package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled}
import colonnade.config.PartConfig
import colonnade.numbers.{Divider, Fixed, Rounding}

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
