package colonnade.query

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, RegEnable}
import colonnade.formats.RaySensor
import colonnade.numbers.{Float32, Normalise}

final class SensorReaderIO extends Bundle {
  val sensor     = Input(new RaySensor) // constant while rays are in the unit
  val runs       = Flipped(Decoupled(new Run))
  val directions = Decoupled(Vec(3, new Float32))
  val isLast     = Output(Bool())       // of its run
}

/** Makes the directions of runs of a sensor, by an addition each: one a cycle, and a cycle between runs. */
final class SensorReader extends Module {
  val io = IO(new SensorReaderIO)

  // A sum a cycle
  private val left   = RegInit(0.U(log2Ceil(Run.rays + 1).W))
  private val sums   = Reg(RaySensor.vector)
  private val starts = Reg(RaySensor.vector) // of the tile's row
  private val isTile = Reg(Bool())
  private val column = Reg(UInt(log2Ceil(Run.tileColumns).W))
  private val wraps  = isTile && column.andR
  private val makes  = left =/= 0.U
  private val valids = Seq.fill(3)(RegInit(false.B))
  private val moves  = !valids.last || io.directions.ready
  io.runs.ready := !makes
  when(makes && moves) {
    left   := left - 1.U
    column := column + 1.U
    for (axis <- 0 until 3) {
      val sum = Mux(wraps, starts(axis), sums(axis)) + Mux(wraps, io.sensor.down(axis), io.sensor.right(axis))
      sums(axis) := sum
      when(wraps) { starts(axis) := sum }
    }
  }
  when(io.runs.fire) {
    left   := io.runs.bits.count
    sums   := io.runs.bits.dir
    starts := io.runs.bits.dir
    isTile := io.runs.bits.isTile
    column := 0.U
  }
  when(moves) { valids.zip(makes +: valids).foreach { case (to, from) => to := from } }

  // Its magnitude, its leading digits, and the nearest float
  io.directions.valid := valids.last
  io.isLast           := Seq.iterate(left === 1.U, 4)(load).last
  for ((sum, float) <- sums.zip(io.directions.bits)) {
    val width    = sum.getWidth
    val digits   = load(Normalise(load(Normalise.magnitude(sum.asSInt)), width))
    val rest     = digits.mantissa(width - Float32.mantissaBits - 1, 0)
    val whole    = digits.mantissa >> (width - Float32.mantissaBits)
    val roundsUp = rest.head(1).asBool && (rest.tail(1).orR || whole(0))
    val rounded  = whole +& roundsUp
    val exponent = digits.exponent +& (Float32.half - RaySensor.fractionBits).U + rounded.head(1)
    val nearest  = Wire(new Float32)
    nearest.isNegative := Seq.iterate(sum(width - 1), 3)(load).last
    nearest.biased     := exponent
    nearest.fraction   := rounded(Float32.mantissaBits - 2, 0)
    when(digits.exponent === 0.U) { nearest := Float32.zero }
    float := load(nearest)
  }

  private def load[T <: Data](value: T): T = RegEnable(value, moves)
}
