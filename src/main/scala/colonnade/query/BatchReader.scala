package colonnade.query

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, Fill}
import colonnade.axi.{Axi, AxiReadPort, AxiWritePort}
import colonnade.formats.{RayBatch, RayRing, RaySensor}

/** `ring` is constant while batches run. */
final class BatchReaderIO(columns: Int) extends Bundle {
  val ring  = Input(new RayRing)
  val tail  = Input(UInt(RayRing.indexBits.W))
  val head  = Output(UInt(RayRing.indexBits.W))
  val read  = new AxiReadPort(1, RayBatch.bytes)
  val write = new AxiWritePort(1, RayBatch.bytes)

  /** A batch starts; it is constant while its runs run, of which some end, or fail. */
  val start    = Output(Bool())
  val batch    = Output(new RayBatch)
  val sensor   = Output(new RaySensor) // of the batch
  val runs     = Decoupled(new Run)
  val resolved = Input(UInt(log2Ceil(2 * columns + 1).W))
  val failed   = Input(Bool())

  /** Pulses: a batch is refused, or has failed; rays of a batch are done. */
  val isError  = Output(Bool())
  val raysDone = Output(UInt(32.W))
  val isBusy   = Output(Bool())
}

/** Reads batches from a ring in memory, and their sensor if they have one, hands out their runs, and writes their tags:
  * one batch after the other.
  *
  * An illegal batch, or one whose sensor cannot be read, has no runs. Its tag, and a batch's tag of which a run has
  * failed, have the error bit. A batch that cannot be read has no tag.
  */
final class BatchReader(columns: Int) extends Module {
  val io = IO(new BatchReaderIO(columns))

  private object State extends ChiselEnum {
    val idle, asking, reading, checking, running, writing, sending, ending = Value
  }
  import State._

  private val state  = RegInit(idle)
  private val head   = RegInit(0.U(RayRing.indexBits.W))
  private val batch  = Reg(new RayBatch)
  private val left   = RegInit(0.U(32.W)) // rays that are in no run yet
  private val rays   = Reg(UInt(Axi.addressBits.W))
  private val hits   = Reg(UInt(Axi.addressBits.W))
  private val inRuns = RegInit(0.U(32.W)) // runs that have not ended
  private val failed = Reg(Bool())
  private val sensor = Reg(new RaySensor)
  private val knows  = RegInit(false.B)   // the batch's sensor
  io.head   := head
  io.batch  := batch
  io.sensor := sensor
  io.isBusy := state =/= idle || io.tail =/= head

  // Read a batch, or its sensor
  private val isBatch = batch.isLegal
  private val asks    = isBatch && batch.isSensor && !knows
  private val isLegal = isBatch && (!batch.isSensor || sensor.isLegal)
  private val reads   = RegInit(false.B) // the sensor
  private val slot    = (head & ((1.U << io.ring.sizeLog) - 1.U)(RayRing.indexBits - 1, 0))
  private val ar      = io.read.ar
  ar.valid        := state === asking
  ar.bits.id      := 0.U
  ar.bits.addr    := Mux(reads, batch.rays, Cat(io.ring.base >> 6, 0.U(6.W)) + Cat(slot, 0.U(6.W)))
  ar.bits.len     := 0.U
  ar.bits.size    := Axi.size(RayBatch.bytes)
  ar.bits.burst   := Axi.incr
  io.read.r.ready := state === reading
  private val isUnread = io.read.r.bits.resp =/= Axi.okay
  io.start := state === checking && !asks && isLegal

  // Hand out its runs
  private val count  = Mux(left > Run.rays.U, Run.rays.U, left)
  private val begins = io.runs.fire
  private val column = Reg(UInt(32.W))                                 // of a sensor
  private val row    = Reg(RaySensor.vector)
  private val dir    = Reg(RaySensor.vector)
  private val band   = Reg(UInt(Axi.addressBits.W))                    // hits of its rows
  private val isTile = Reg(Bool())
  private val width  = Mux(isTile, Run.tileColumns.U, Run.rays.U)
  private val wraps  = column + width === sensor.columns
  private val hitLog = Mux(batch.response === RayBatch.hits, 4.U, 3.U) // of the bytes of a hit or a range

  /** Rows of the sensor that have so many rays are traced in tiles, except for occlusion. */
  private def hasTiles(left: UInt): Bool =
    batch.isSensor && batch.response =/= RayBatch.occluded && left >= (sensor.columns << log2Ceil(Run.tileRows))
  io.runs.valid       := state === running && left =/= 0.U
  io.runs.bits.rays   := rays
  io.runs.bits.hits   := hits
  io.runs.bits.count  := count
  io.runs.bits.dir    := dir
  io.runs.bits.isTile := isTile
  when(begins) {
    val rest = left - count
    left   := rest
    rays   := rays + Mux(batch.isFan, (16 * Run.rays).U, (32 * Run.rays).U)
    hits   := hits + Mux(batch.response === RayBatch.occluded, (Run.rays / 8).U, width << hitLog)
    column := Mux(wraps, 0.U, column + width)
    for (axis <- 0 until 3) {
      val next = row(axis) + Mux(isTile, sensor.down(axis) << log2Ceil(Run.tileRows), sensor.down(axis))
      when(wraps) { row(axis) := next }
      dir(axis) := Mux(
        wraps,
        next,
        dir(axis) + (sensor.right(axis) << Mux(isTile, log2Ceil(Run.tileColumns).U, log2Ceil(Run.rays).U))
      )
    }
    when(wraps) { isTile := hasTiles(rest) }
    when(wraps && isTile) {
      val next = band + (sensor.columns << log2Ceil(Run.tileRows) << hitLog)
      band := next
      hits := next
    }
  }
  inRuns := inRuns + begins - io.resolved
  when(io.failed) { failed := true.B }

  // Write its tag
  private val aw = io.write.aw
  private val w  = io.write.w
  aw.valid         := state === writing
  aw.bits.id       := 0.U
  aw.bits.addr     := Cat(batch.done(Axi.addressBits - 1, 6), 0.U(6.W))
  aw.bits.len      := 0.U
  aw.bits.size     := Axi.size(RayBatch.bytes)
  aw.bits.burst    := Axi.incr
  w.valid          := state === sending
  w.bits.data      := Fill(16, batch.tag | Mux(failed, RayBatch.errorBit.U, 0.U))
  w.bits.strb      := 15.U << Cat(batch.done(5, 2), 0.U(2.W))
  w.bits.last      := true.B
  io.write.b.ready := state === ending

  private val isDone    = state === running && left === 0.U && inRuns === 0.U
  private val leaves    = isDone && batch.done === 0.U || io.write.b.fire || (io.read.r.fire && isUnread && !reads)
  private val isTagless = state === checking && !asks && !isLegal &&
    (batch.done === 0.U || batch.done(1, 0) =/= 0.U || (batch.done >> Axi.addressBits) =/= 0.U)
  when(state === idle && io.tail =/= head) { state := asking }
  when(ar.fire) { state := reading }
  when(io.read.r.fire) {
    when(reads) {
      sensor := io.read.r.bits.data.asTypeOf(sensor)
      when(isUnread) { sensor.columns := 0.U }
    }.otherwise { batch := io.read.r.bits.data.asTypeOf(batch) }
    knows := reads
    reads := false.B
    state := checking
  }
  when(state === checking) {
    state  := Mux(asks, asking, Mux(isLegal, running, writing))
    reads  := asks
    column := 0.U
    row    := sensor.corner
    dir    := sensor.corner
    left   := batch.count
    rays   := batch.rays
    hits   := batch.hits
    band   := batch.hits
    isTile := hasTiles(batch.count)
    failed := !isLegal
  }
  when(isDone) { state := writing }
  when(aw.fire) { state := sending }
  when(w.fire) { state := ending }
  when(leaves || isTagless) {
    state := idle
    head  := head + 1.U
  }
  io.isError := (leaves && (failed || isUnread && state === reading && !reads)) || isTagless ||
    (io.write.b.fire && io.write.b.bits.resp =/= Axi.okay)
  io.raysDone := Mux(isDone, batch.count, 0.U)
}
