package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, PopCount, PriorityEncoder, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.ray.Context

/** What a context is at. */
object Stage extends ChiselEnum {

  /** Holds no pixel. */
  val free = Value

  /** Its ray is generated or set up. */
  val setUp = Value

  /** Its ray visits records. */
  val traversal = Value

  /** Its ray has ended; the outcome waits to be judged. */
  val ended = Value

  /** Its hit waits for attributes, or is in the shader. */
  val shading = Value

  /** Its pixel's colour is known. */
  val complete = Value
}

/** A context that has been shaded. */
final class Shaded(config: ColonnadeConfig) extends Bundle {
  val context        = Context(config)
  val needsShadowRay = Bool()
}

/** Decides which ray goes to which stage next; knows no arithmetic.
  *
  * A context goes free → set-up → traversal → ended → shading → (set-up → traversal → ended, of its shadow ray) →
  * complete → free. Contexts are tokens: no more than `contexts` of them exist, so whatever they wait in never
  * overflows. One ended ray is judged a cycle, one pixel leaves a cycle; all else is without limit.
  */
final class RtController(config: ColonnadeConfig) extends Module {
  private val contexts = config.array.contexts

  val io = IO(new Bundle {

    /** A context that may take a pixel, and whether it does. */
    val free     = Output(Valid(Context(config)))
    val allocate = Input(Bool())

    /** A set-up ray enters the object's box. */
    val entered = Flipped(Valid(Context(config)))

    /** Rays that ended: outside the box, with nothing left to visit, or occluded. */
    val ended = Flipped(Vec(3, Valid(Context(config))))

    /** The ended ray that is judged now; a primary one that has hit goes on to shading. */
    val judged = Output(Valid(Context(config)))
    val hasHit = Input(Vec(contexts, Bool()))

    val shaded = Flipped(Valid(new Shaded(config)))

    /** Attributes that cannot be had: the pixel ends as it is. */
    val dropped = Flipped(Valid(Context(config)))

    /** A complete pixel, and whether it leaves. */
    val complete = Output(Valid(Context(config)))
    val leave    = Input(Bool())

    /** By context: its ray is a shadow ray. */
    val isShadow = Output(Vec(contexts, Bool()))

    /** Contexts that hold no pixel, and whose ray is generated or set up. */
    val freeCount  = Output(UInt(log2Ceil(contexts + 1).W))
    val setUpCount = Output(UInt(log2Ceil(contexts + 1).W))
  })

  private val stage    = RegInit(VecInit(Seq.fill(contexts)(Stage.free)))
  private val isShadow = Reg(Vec(contexts, Bool()))
  io.isShadow := isShadow

  private def isAt(wanted: Stage.Type): Seq[Bool] = stage.map(_ === wanted)

  private def anyAt(wanted: Stage.Type): Valid[UInt] = {
    val found = Wire(Valid(Context(config)))
    found.valid := isAt(wanted).reduce(_ || _)
    found.bits  := PriorityEncoder(isAt(wanted))
    found
  }

  io.free       := anyAt(Stage.free)
  io.judged     := anyAt(Stage.ended)
  io.complete   := anyAt(Stage.complete)
  io.freeCount  := PopCount(isAt(Stage.free))
  io.setUpCount := PopCount(isAt(Stage.setUp))

  when(io.allocate) {
    stage(io.free.bits)    := Stage.setUp
    isShadow(io.free.bits) := false.B
  }
  when(io.entered.valid) { stage(io.entered.bits) := Stage.traversal }
  io.ended.foreach(ended => when(ended.valid) { stage(ended.bits) := Stage.ended })
  when(io.judged.valid) {
    val isSeen = !isShadow(io.judged.bits) && io.hasHit(io.judged.bits)
    stage(io.judged.bits) := Mux(isSeen, Stage.shading, Stage.complete)
  }
  when(io.shaded.valid) {
    stage(io.shaded.bits.context)    := Mux(io.shaded.bits.needsShadowRay, Stage.setUp, Stage.complete)
    isShadow(io.shaded.bits.context) := io.shaded.bits.needsShadowRay
  }
  when(io.dropped.valid) { stage(io.dropped.bits) := Stage.complete }
  when(io.leave) { stage(io.complete.bits) := Stage.free }
}
