package colonnade.column

import chisel3._
import chisel3.experimental.noPrefix
import chisel3.experimental.hierarchy.{Definition, Instance}
import chisel3.util.{Decoupled, DecoupledIO, Mux1H, RegEnable, Valid}
import colonnade.common.RoundRobin
import colonnade.config.{ColonnadeConfig, PathConfig, TraversalConfig}
import colonnade.formats.{Leaf, RecordBroadcast, SceneMap}
import colonnade.ray.PreparedRay
import colonnade.unit.{TraceResult, TraversalUnit}

/** The traversal units of a column, their buses and triangle units, as parts of the module that makes them. */
final private[colonnade] class TraversalRows(config: ColonnadeConfig) {

  // A definition: the unit is elaborated once, not once per row. Without prefix the instances are TraversalUnit,
  // TraversalUnit_1…
  private val definition = Definition(new TraversalUnit(TraversalConfig(config)))

  /** By row. Their requests and events are the column's. */
  val units = Seq.fill(config.array.rows)(noPrefix(Instance(definition)).io)

  /** Traces rays; `scene` and `mask` are constant meanwhile, and `start` precedes the first one.
    *
    * @param mask of rays of applications: they hit leaves with a bit in common
    * @return what each ray has met, in any order
    */
  def connect(
      from:       DecoupledIO[PreparedRay],
      scene:      SceneMap,
      start:      Bool,
      broadcasts: Vec[Valid[RecordBroadcast]],
      mask:       Option[UInt] = None
  ): Valid[TraceResult] = noPrefix {
    val rays    = Module(new RayBus(config)).io
    val results = Module(new ResultBus(config)).io
    rays.rays :<>= from
    for ((unit, row) <- units.zipWithIndex) {
      unit.row         := row.U
      unit.scene       := scene
      unit.start       := start
      unit.rays        := rays.units(row)
      rays.isFree(row) := unit.isFree
      results.units(row) :<>= unit.results
    }
    for (rows <- units.grouped(config.units.triangleRows)) {
      val group = Module(new TriangleGroup(config, rows.size)).io
      for ((unit, row) <- rows.zipWithIndex) {
        unit.triangleLanes :<>= group.rows(row)
        for (rays <- mask; candidate = group.rows(row).candidate.bits; isMasked <- candidate.isMasked)
          isMasked       := (new Leaf(config.geometry, candidate.record).material & rays) === 0.U
        group.waits(row) := unit.waitsForTriangles
      }
    }
    units.foreach(_.broadcasts := broadcasts)
    results.results
  }
}

final class RayBusIO(config: ColonnadeConfig) extends Bundle {
  val rays = Flipped(Decoupled(new PreparedRay(PathConfig(config))))

  /** By row: the unit has an idle context, without regard to a ray that comes in this cycle. */
  val isFree = Input(Vec(config.array.rows, Bool()))
  val units  = Vec(config.array.rows, Valid(new PreparedRay(PathConfig(config))))
}

/** Sends each ray to a traversal unit with an idle context, by round-robin, so that rays spread evenly.
  *
  * Throughput: a ray a cycle, to one unit every other cycle. Latency: one cycle. The unit that receives a ray is not
  * chosen for the next one in the same cycle, because `isFree` does not count that ray yet. So a ray on the bus is
  * never refused.
  */
final class RayBus(config: ColonnadeConfig) extends Module {
  val io = IO(new RayBusIO(config))

  private val rows    = config.array.rows
  private val targets = RegInit(0.U(rows.W))
  private val arbiter = Module(new RoundRobin(rows)).io
  private val ray     = RegEnable(io.rays.bits, io.rays.fire)
  arbiter.requests := io.isFree.asUInt & ~targets
  arbiter.isTaken  := io.rays.fire
  io.rays.ready    := arbiter.requests.orR
  targets          := Mux(io.rays.fire, arbiter.grant, 0.U)
  io.units.zip(targets.asBools).foreach { case (unit, isTarget) =>
    unit.valid := isTarget
    unit.bits  := ray
  }
}

final class ResultBusIO(config: ColonnadeConfig) extends Bundle {

  /** By row. */
  val units   = Vec(config.array.rows, Flipped(Decoupled(new TraceResult(PathConfig(config)))))
  val results = Valid(new TraceResult(PathConfig(config)))
}

/** Collects the results of traversal units, by round-robin. Throughput: one per cycle. Latency: one cycle. */
final class ResultBus(config: ColonnadeConfig) extends Module {
  val io = IO(new ResultBusIO(config))

  private val arbiter  = Module(new RoundRobin(config.array.rows)).io
  private val isChosen = arbiter.grant.orR
  arbiter.requests := VecInit(io.units.map(_.valid)).asUInt
  arbiter.isTaken  := isChosen
  io.units.zip(arbiter.grant.asBools).foreach { case (unit, isGranted) => unit.ready := isGranted }
  io.results.valid := RegNext(isChosen, false.B)

  // Of legal outcomes one is chosen: a legal one
  private val result = suppressEnumCastWarning(Mux1H(arbiter.grant, io.units.map(_.bits)))
  io.results.bits := RegEnable(result, isChosen)
}
