package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Queue, Valid}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.formats.{ChildKind, RecordFormats, SceneMap}
import colonnade.numbers.Fixed
import colonnade.ray.{BoxRay, RayFormats}
import colonnade.traversal.{BoxUnit, ExhaustiveWalk, NextVisit, TraversalStack, Visit}

/** Which record each ray visits next: BoxUnit and TraversalStack, or without a BVH the exhaustive walk. */
final class Traversal(config: ColonnadeConfig) extends Module {
  private val contexts = config.array.contexts

  val io = IO(new Bundle {
    val clear = Input(Bool())
    val scene = Input(new SceneMap(RecordFormats.idBits(config)))

    /** A ray enters the object's box; its first visit is [[Traversal.firstVisit]]. */
    val start = Flipped(Valid(Context(config)))

    /** A node for a context. */
    val nodes = Flipped(Decoupled(new ServedRecord(config)))

    /** `nodes` will be ready in the next cycle. */
    val takesNext = Output(Bool())

    /** The ray of `nodes.bits.context`. */
    val ray = Input(new BoxRay(config.numbers))

    /** Contexts that are through with a triangles record. */
    val resume = Flipped(Decoupled(Context(config)))
    val limits = Input(Vec(contexts, new Fixed(new RayFormats(config.numbers).units)))
    val visits = Decoupled(new NextVisit(config))

    /** For the counters. */
    val boxTests = Output(UInt(log2Ceil(config.geometry.arity + 1).W))
    val busy     = Output(Bool())
    val deepest  = Output(UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W))
    val overflow = Output(Bool())

    /** A node was illegal and counted as empty. */
    val illegal = Output(Bool())
  })

  /** Contexts are tokens: a queue of as many places never fills. */
  private val resume = Queue(io.resume, contexts)

  if (config.geometry.bvh) {
    val boxUnit = Module(new BoxUnit(config))
    val stack   = Module(new TraversalStack(config))
    val node    = new RecordFormats(config).asNode(io.nodes.bits.record)
    val isLegal = node.isLegal(io.nodes.bits.address)

    boxUnit.io.in.valid        := io.nodes.valid
    boxUnit.io.in.bits.context := io.nodes.bits.context
    boxUnit.io.in.bits.node    := node
    when(!isLegal)(boxUnit.io.in.bits.node.kinds.foreach(_ := ChildKind.empty))
    boxUnit.io.in.bits.ray   := io.ray
    boxUnit.io.in.bits.limit := io.limits(io.nodes.bits.context)
    io.nodes.ready           := boxUnit.io.in.ready
    io.takesNext             := boxUnit.io.takesNext

    stack.io.clear := io.clear
    stack.io.start := io.start
    stack.io.results :<>= boxUnit.io.out
    stack.io.resume :<>= resume
    stack.io.limits := io.limits
    io.visits :<>= stack.io.visits

    io.boxTests := Mux(boxUnit.io.out.fire, boxUnit.io.out.bits.tests, 0.U)
    io.busy     := boxUnit.io.busy
    io.deepest  := stack.io.deepest
    io.overflow := stack.io.overflow
    io.illegal  := io.nodes.fire && !isLegal
  } else {
    val walk = Module(new ExhaustiveWalk(config))
    walk.io.scene := io.scene
    walk.io.start := io.start
    walk.io.resume :<>= resume
    io.visits :<>= walk.io.visits

    io.nodes.ready := true.B
    io.takesNext   := true.B
    io.boxTests    := 0.U
    io.busy        := false.B
    io.deepest     := 0.U
    io.overflow    := false.B
    io.illegal     := false.B
  }
}

object Traversal {

  /** Where every ray begins: the root, or without a BVH the first triangles record. */
  def firstVisit(config: ColonnadeConfig, scene: SceneMap): Visit = {
    val visit = Wire(new Visit(config))
    visit.isLeaf  := (!config.geometry.bvh).B
    visit.address := (if (config.geometry.bvh) 0.U else scene.triangleBase)
    visit
  }
}
