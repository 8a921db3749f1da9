package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, PopCount, PriorityEncoder, Valid}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.shading.{Occlusion, PathEnd, ShadowQuestion}

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

  /** Its hit waits for attributes, or is in the shader, as a point of the room may be. */
  val shading = Value

  /** Its surface is known; lights may be left to ask for. */
  val lit = Value

  /** Its ray has met nothing of the object: it waits to meet the room, or looks for it. */
  val beyond, room = Value

  /** Its path turns, as soon as that can be coloured: there is nothing beside it. */
  val turning = Value

  /** Its path's end is known; its colour waits to be made, or is being made. */
  val colouring, coloured = Value

  /** Its pixel's colour is known. */
  val complete = Value
}

/** Decides which ray goes to which stage next; knows no arithmetic.
  *
  * A context goes free → set-up → traversal → ended → shading, from a mirror or glass again → set-up and so on; then
  * lit → (set-up → traversal → ended, of a shadow ray, → lit, light by light) → colouring → complete → free. A primary
  * ray that meets nothing is complete at once; a later ray goes to colouring. Contexts are tokens: no more than `contexts`
  * of them exist, so whatever they wait in never overflows. One ended ray is judged a cycle, one lit context goes on, one
  * pixel leaves; all else is without limit.
  *
  * In a room a ray that meets nothing goes on: beyond → room → shading, or without a point of the room to where it would
  * have gone. What glass reflects is met beside the path: shading → beyond → room → shading → lit, then it turns; without
  * a point it waits in turning.
  */
final class RtController(config: ColonnadeConfig) extends Module {
  private val contexts = config.array.contexts
  private val lights   = config.frame.lights

  val io = IO(new Bundle {

    /** A context that may take a pixel, and whether it does. */
    val free     = Output(Valid(Context(config)))
    val allocate = Input(Bool())

    /** A set-up ray enters the object's box. */
    val entered = Flipped(Valid(Context(config)))

    /** Rays that ended: outside the box, with nothing left to visit, or occluded. */
    val ended = Flipped(Vec(3, Valid(Context(config))))

    /** The ended ray that is judged now; one that is no shadow ray and has hit goes on to shading. */
    val judged     = Output(Valid(Context(config)))
    val hasHit     = Input(Vec(contexts, Bool()))
    val occlusions = Input(Vec(contexts, Occlusion()))

    val shaded  = Flipped(Valid(new Shaded(config)))
    val bounced = Flipped(Valid(new Bounced(config)))

    val room = if (config.hasRoom) Some(new RoomControl(config)) else None

    /** Attributes that cannot be had: the path ends in the background. */
    val dropped = Flipped(Valid(Context(config)))

    /** A light that a lit context has not asked for yet. */
    val shadow = Decoupled(new ShadowQuestion(config))

    /** A path whose end is known, and the context whose colour is. */
    val end      = Decoupled(new PathEnd(config))
    val coloured = Flipped(Valid(Context(config)))

    /** A complete pixel, and whether it leaves. */
    val complete = Output(Valid(Context(config)))
    val leave    = Input(Bool())

    /** By context: its ray is a shadow ray; its ray is the primary one; its pixel has a colour of its own. */
    val isShadow   = Output(Vec(contexts, Bool()))
    val isPrimary  = Output(Vec(contexts, Bool()))
    val isColoured = Output(Vec(contexts, Bool()))

    /** Contexts that hold no pixel, and whose ray is generated or set up. */
    val freeCount  = Output(UInt(log2Ceil(contexts + 1).W))
    val setUpCount = Output(UInt(log2Ceil(contexts + 1).W))

    /** Those that wait for the room or look for it. */
    val roomCount = if (config.hasRoom) Some(Output(UInt(log2Ceil(contexts + 1).W))) else None
  })

  private val stage        = RegInit(VecInit(Seq.fill(contexts)(Stage.free)))
  private val isShadow     = Reg(Vec(contexts, Bool()))
  private val isPrimary    = Reg(Vec(contexts, Bool()))
  private val isColoured   = Reg(Vec(contexts, Bool()))
  private val isBackground = Reg(Vec(contexts, Bool()))

  /** The pixel shows the room. */
  private val isSeen = if (config.hasRoom) Reg(Vec(contexts, Bool())) else VecInit.fill(contexts)(false.B)

  /** The ray is beside the path. */
  private val isAside = if (config.hasRoom) Reg(Vec(contexts, Bool())) else VecInit.fill(contexts)(false.B)
  private val hasRoom = io.room.map(_.isThere).getOrElse(false.B)

  /** By light: a shadow ray is wanted; what those that were sent have met. */
  private val wanted     = Reg(Vec(contexts, Vec(lights, Bool())))
  private val occlusions = Reg(Vec(contexts, Vec(lights, Occlusion())))

  /** The light of a context's shadow ray. */
  private val asked = Reg(Vec(contexts, chiselTypeOf(io.shadow.bits.light)))
  io.isShadow   := isShadow
  io.isPrimary  := isPrimary
  io.isColoured := isColoured

  private def isAt(wanted: Stage.Type): Seq[Bool] = stage.map(_ === wanted)

  private def anyOf(claims: Seq[Bool]): Valid[UInt] = {
    val found = Wire(Valid(Context(config)))
    found.valid := claims.reduce(_ || _)
    found.bits  := PriorityEncoder(claims)
    found
  }

  io.free       := anyOf(isAt(Stage.free))
  io.judged     := anyOf(isAt(Stage.ended))
  io.complete   := anyOf(isAt(Stage.complete))
  io.freeCount  := PopCount(isAt(Stage.free))
  io.setUpCount := PopCount(isAt(Stage.setUp))

  when(io.allocate) {
    stage(io.free.bits)      := Stage.setUp
    isShadow(io.free.bits)   := false.B
    isPrimary(io.free.bits)  := true.B
    isColoured(io.free.bits) := false.B
    if (config.hasRoom) {
      isAside(io.free.bits) := false.B
      isSeen(io.free.bits)  := false.B
    }
  }
  when(io.entered.valid) { stage(io.entered.bits) := Stage.traversal }
  io.ended.foreach(ended => when(ended.valid) { stage(ended.bits) := Stage.ended })

  // Judge
  private val judged = io.judged.bits
  when(io.judged.valid) {
    when(isShadow(judged)) {
      stage(judged) := Stage.lit
      for (light <- 0 until lights)
        when((lights == 1).B || asked(judged) === light.U) { occlusions(judged)(light) := io.occlusions(judged) }
    }.elsewhen(io.hasHit(judged)) {
      stage(judged) := Stage.shading
    }.otherwise {
      stage(judged) := Mux(hasRoom, Stage.beyond, Mux(isPrimary(judged), Stage.complete, Stage.colouring))
    }
    isBackground(judged) := !isShadow(judged) && !io.hasHit(judged)
  }

  // After the shader
  when(io.shaded.valid) {
    stage(io.shaded.bits.context)        := Stage.lit
    wanted(io.shaded.bits.context)       := io.shaded.bits.needsShadowRays
    occlusions(io.shaded.bits.context)   := VecInit.fill(lights)(Occlusion.none)
    isBackground(io.shaded.bits.context) := false.B
  }
  when(io.bounced.valid) {
    stage(io.bounced.bits.context) :=
      Mux(io.bounced.bits.isTraced, Stage.setUp, Mux(hasRoom, Stage.beyond, Stage.colouring))
    isPrimary(io.bounced.bits.context)    := false.B
    isBackground(io.bounced.bits.context) := true.B
  }
  when(io.dropped.valid) {
    stage(io.dropped.bits)        := Stage.colouring
    isBackground(io.dropped.bits) := true.B
  }

  // Lit contexts ask for one light after the other, then go on
  private val isDark = stage.zip(wanted).map { case (at, lights) => at === Stage.lit && lights.reduce(_ || _) }
  private val seeker = anyOf(isDark)
  private val wishes = wanted(seeker.bits)
  io.shadow.valid        := seeker.valid
  io.shadow.bits.context := seeker.bits
  io.shadow.bits.light   := PriorityEncoder(wishes)
  when(io.shadow.fire) {
    stage(seeker.bits)    := Stage.setUp
    isShadow(seeker.bits) := true.B
    asked(seeker.bits)    := io.shadow.bits.light
    for (light <- 0 until lights) when(io.shadow.bits.light === light.U) { wanted(seeker.bits)(light) := false.B }
  }

  // A lit context that wants no light any more, or a path into the background, ends
  private val isLit = stage.zip(wanted).map { case (at, lights) => at === Stage.lit && !lights.reduce(_ || _) }
  private val ends  = stage.zip(isLit.zip(isAside)).map { case (at, (lit, aside)) =>
    at === Stage.colouring || (lit && !aside)
  }
  private val ending = anyOf(ends)
  io.end.valid             := ending.valid
  io.end.bits.context      := ending.bits
  io.end.bits.isBackground := isBackground(ending.bits)
  io.end.bits.occlusions   := occlusions(ending.bits)
  io.end.bits.isSeen.foreach(_ := isSeen(ending.bits))
  when(io.end.fire) { stage(ending.bits) := Stage.coloured }
  when(io.coloured.valid) {
    stage(io.coloured.bits)      := Stage.complete
    isColoured(io.coloured.bits) := true.B
  }
  when(io.leave) { stage(io.complete.bits) := Stage.free }

  // Beyond the object
  for (room <- io.room) {
    when(room.passes.valid) { stage(room.passes.bits) := Stage.beyond }
    when(room.aside.valid) {
      stage(room.aside.bits)     := Stage.beyond
      isAside(room.aside.bits)   := true.B
      isPrimary(room.aside.bits) := false.B
    }
    val asks = anyOf(isAt(Stage.beyond))
    io.roomCount.get           := PopCount(stage.map(at => at === Stage.beyond || at === Stage.room))
    room.question.valid        := asks.valid
    room.question.bits.context := asks.bits
    room.question.bits.isSeen  := isPrimary(asks.bits)
    room.question.bits.isAside := isAside(asks.bits)
    when(room.question.fire) {
      stage(asks.bits)    := Stage.room
      isSeen(asks.bits)   := room.question.bits.isSeen
      isShadow(asks.bits) := false.B
    }
    when(room.met.valid) { stage(room.met.bits) := Stage.shading }
    val none = room.nothing.bits
    when(room.nothing.valid) {
      stage(none)        := Mux(isAside(none), Stage.turning, Mux(isPrimary(none), Stage.complete, Stage.colouring))
      isBackground(none) := true.B
    }
    val turns = anyOf(isAt(Stage.turning).zip(isLit.zip(isAside)).map { case (turning, (lit, aside)) =>
      turning || (lit && aside)
    })
    room.turn.valid             := turns.valid
    room.turn.bits.context      := turns.bits
    room.turn.bits.isBackground := isBackground(turns.bits)
    when(room.turn.fire) {
      stage(turns.bits)   := Stage.shading
      isAside(turns.bits) := false.B
    }
  }
}
