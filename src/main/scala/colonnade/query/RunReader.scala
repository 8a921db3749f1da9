package colonnade.query

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, Queue, RegEnable}
import colonnade.axi.{Axi, AxiReadPort}
import colonnade.common.Context
import colonnade.config.PathConfig
import colonnade.formats.{RayBatch, RayRecord, RaySensor}
import colonnade.numbers.{Float32, Normalise}

/** Rays of a batch: consecutive ones, or a tile of a sensor, row by row. */
final class Run extends Bundle {
  val rays   = UInt(Axi.addressBits.W)
  val hits   = UInt(Axi.addressBits.W)
  val count  = UInt(log2Ceil(Run.rays + 1).W)
  val dir    = RaySensor.vector // of the first ray of a sensor
  val isTile = Bool()
}

object Run {
  val rays: Int = 64

  /** Columns and rows of a tile. */
  val tileColumns: Int = 16
  val tileRows:    Int = rays / tileColumns

  /** Beats of a burst, which begins at any and ends at a multiple of this length: it crosses no 4 KB. */
  val burstBeats: Int = 8
  val beatBits:   Int = 8 * RayBatch.bytes

  /** Beats up to the end of a burst at an address. */
  def beatsAt(address: UInt, left: UInt): UInt = {
    val low  = log2Ceil(RayBatch.bytes)
    val most = burstBeats.U -& address(low + log2Ceil(burstBeats) - 1, low)
    Mux(left < most, left, most)
  }
}

final class RunReaderIO(config: PathConfig) extends Bundle {
  val batch   = Input(new RayBatch)    // constant while its runs are read
  val runs    = Flipped(Decoupled(new Run))
  val sensor  = Input(new RaySensor)   // of the batch
  val axi     = new AxiReadPort(1, RayBatch.bytes)
  val rays    = Decoupled(new BatchRay(config))
  val context = Input(Context(config)) // of the ray that comes out

  /** The ray is the last one of its run; it comes with rays that could not be read. */
  val isLast    = Output(Bool())
  val hasFailed = Output(Bool())
}

/** Reads the rays of runs by bursts, or makes a sensor's rays. A burst is read when all its beats have a place, so that
  * the port never waits for the rays before it.
  */
final class RunReader(config: PathConfig) extends Module {
  import RunReader._

  val io = IO(new RunReaderIO(config))

  private val isFan = io.batch.isFan

  // Addresses
  private val address  = Reg(UInt(Axi.addressBits.W))
  private val left     = RegInit(0.U(log2Ceil(Run.rays + 1).W))
  private val reserved = RegInit(0.U(log2Ceil(queueDepth + 1).W))
  private val begun    = Module(new Queue(UInt(log2Ceil(Run.rays + 1).W), aheadRuns)).io
  private val beats    = Module(new Queue(new ReadBeat, queueDepth, useSyncReadMem = true)).io
  private val burst    = Run.beatsAt(address, left)
  private val ar       = io.axi.ar
  private val sensor   = Module(new SensorReader).io
  private val isSensor = io.batch.isSensor
  io.runs.ready   := Mux(isSensor, sensor.runs.ready, left === 0.U && begun.enq.ready)
  begun.enq.valid := io.runs.valid && left === 0.U && !isSensor
  begun.enq.bits  := io.runs.bits.count
  ar.valid        := left =/= 0.U && reserved +& burst <= queueDepth.U
  ar.bits.id      := 0.U
  ar.bits.addr    := address
  ar.bits.len     := burst - 1.U
  ar.bits.size    := Axi.size(RayBatch.bytes)
  ar.bits.burst   := Axi.incr
  when(ar.fire) {
    address := address + (burst << log2Ceil(RayBatch.bytes))
    left    := left - burst
  }
  when(io.runs.fire && !isSensor) {
    address := io.runs.bits.rays
    left    := Mux(isFan, (io.runs.bits.count +& 3.U) >> 2, (io.runs.bits.count +& 1.U) >> 1)
  }
  reserved := reserved + Mux(ar.fire, burst, 0.U) - beats.deq.fire

  // Beats, each of which has a place
  beats.enq.valid        := io.axi.r.valid
  beats.enq.bits.data    := io.axi.r.bits.data
  beats.enq.bits.isError := io.axi.r.bits.resp =/= Axi.okay
  io.axi.r.ready         := true.B
  assert(!io.axi.r.valid || beats.enq.ready, "a beat of rays has no place")

  // Rays
  private val index    = RegInit(0.U(log2Ceil(Run.rays).W))
  private val isLast   = index +& 1.U === begun.deq.bits
  private val slot     = Mux(isFan, index(1, 0), index(0) ## 0.U(1.W))
  private val quarters = VecInit(Seq.tabulate(4)(i => beats.deq.bits.data(128 * i + 127, 128 * i)))
  private val ofBatch  = Cat(io.batch.tNear.asUInt, io.batch.origin.asUInt)
  private val made     = Cat(io.batch.tFar.asUInt, sensor.directions.bits.asUInt)
  private val record   =
    Mux(isFan || isSensor, Cat(Mux(isSensor, made, quarters(slot)), ofBatch), Cat(quarters(slot | 1.U), quarters(slot)))
  sensor.sensor           := io.sensor
  sensor.runs.valid       := io.runs.valid && isSensor
  sensor.runs.bits        := io.runs.bits
  sensor.directions.ready := io.rays.ready
  private val isRead = beats.deq.valid && begun.deq.valid
  io.rays.valid                    := isRead || sensor.directions.valid
  io.rays.bits.context             := io.context
  io.rays.bits.isOccluded          := io.batch.response === RayBatch.occluded
  io.rays.bits.isLocal             := io.batch.isLocal
  io.rays.bits.filter.cullsFront   := io.batch.cullsFront
  io.rays.bits.filter.cullsBack    := io.batch.cullsBack
  io.rays.bits.filter.refusesClear := io.batch.refusesClear
  io.rays.bits.record              := record.asTypeOf(new RayRecord)
  beats.deq.ready                  := isRead && io.rays.ready && (isLast || slot(1) && (slot(0) || !isFan))
  begun.deq.ready                  := isRead && io.rays.ready && isLast
  when(isRead && io.rays.ready) { index := Mux(isLast, 0.U, index + 1.U) }
  io.isLast    := Mux(isSensor, sensor.isLast, isLast)
  io.hasFailed := beats.deq.fire && beats.deq.bits.isError
}

object RunReader {

  /** Beats that are read or awaited. */
  private val queueDepth = 2 * Run.burstBeats

  /** Runs that are read before their rays leave. */
  private val aheadRuns = 2
}

final private class ReadBeat extends Bundle {
  val data    = UInt(Run.beatBits.W)
  val isError = Bool()
}

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
